use deepfusion_geometry::DepthMap;
use image::RgbImage;
use image::imageops::{self, FilterType};

/// The picture scaled to at most `widest` pixels wide, with the same proportions.
#[must_use]
pub fn shrink_picture(picture: &RgbImage, widest: u32) -> RgbImage {
    let size = shrunk_size(picture.dimensions(), widest);
    if size == picture.dimensions() {
        return picture.clone();
    }
    imageops::resize(picture, size.0, size.1, FilterType::Triangle)
}

/// A size at most `widest` wide, with the same proportions, at least one pixel high.
pub(crate) fn shrunk_size((width, height): (u32, u32), widest: u32) -> (u32, u32) {
    if width <= widest || width == 0 {
        return (width, height);
    }
    let shrunk = f64::from(height) * f64::from(widest) / f64::from(width);
    (widest, (shrunk.round() as u32).max(1))
}

/// Depth at a smaller size: each pixel takes the smallest of the depths that fall into it, so that sparse depth is kept.
#[must_use]
pub fn shrink_depth(map: &DepthMap, (width, height): (u32, u32)) -> DepthMap {
    let (width, height) = (width as usize, height as usize);
    if (map.width, map.height) == (width, height) {
        return map.clone();
    }
    let mut out = DepthMap::empty(width, height);
    for (i, depth) in map.data.iter().enumerate() {
        if *depth > 0.0 && width > 0 && height > 0 {
            let (x, y) = (i % map.width, i / map.width);
            out.set_nearest(x * width / map.width, y * height / map.height, *depth);
        }
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sparse_depth_survives_shrinking() {
        let mut map = DepthMap::empty(8, 4);
        map.set_nearest(5, 3, 20.0);
        map.set_nearest(4, 3, 10.0);
        let small = shrink_depth(&map, (4, 2));
        assert_eq!(small.count(), 1);
        assert_eq!(small.get(2, 1), Some(10.0));
        assert!(shrink_depth(&map, (0, 0)).data.is_empty());
    }

    #[test]
    fn pictures_keep_their_proportions() {
        assert_eq!(
            shrink_picture(&RgbImage::new(1242, 375), 621).dimensions(),
            (621, 188)
        );
        assert_eq!(
            shrink_picture(&RgbImage::new(30, 7), 60).dimensions(),
            (30, 7)
        );
        assert_eq!(shrunk_size((5000, 1), 100), (100, 1));
    }
}
