use image::{Rgb, RgbImage};

use crate::depth_picture::percentile;
use crate::error::require_size;
use crate::{ColourMap, Result};

/// Share of the map's colour in a pixel; the rest is the picture in grey.
const OPACITY: f32 = 0.6;

/// A coarse map (H×W, row by row, of any size) laid over a picture. The picture is grey, the colours show the map's
/// values, from dark blue for `range[0]` to red for `range[1]`. The map is interpolated between its pixels.
///
/// # Errors
/// [`crate::Error::Size`] unless `map` has `width * height` values.
pub fn feature_picture(
    picture: &RgbImage,
    map: &[f32],
    (width, height): (usize, usize),
    range: [f32; 2],
) -> Result<RgbImage> {
    require_size("feature map", map.len(), (width as u32, height as u32))?;
    let mut out = picture.clone();
    if map.is_empty() {
        return Ok(out);
    }
    let [low, high] = range;
    let span = (high - low).max(f32::MIN_POSITIVE);
    let (columns, rows) = (axis(width, out.width()), axis(height, out.height()));
    for (x, y, pixel) in out.enumerate_pixels_mut() {
        let ((left, right, fx), (top, bottom, fy)) = (columns[x as usize], rows[y as usize]);
        let row = |y: usize| {
            let (a, b) = (map[y * width + left], map[y * width + right]);
            a + (b - a) * fx
        };
        let value = row(top) + (row(bottom) - row(top)) * fy;
        let Rgb(colour) = ColourMap::Turbo.colour((value - low) / span);
        let [r, g, b] = pixel.0.map(f32::from);
        let grey = 0.299 * r + 0.587 * g + 0.114 * b;
        *pixel =
            Rgb(colour.map(|c| (OPACITY * f32::from(c) + (1.0 - OPACITY) * grey).round() as u8));
    }
    Ok(out)
}

/// The range that shows a map's structure: from its 2nd to its 98th percentile, so that a few outliers (the corners
/// of zero-padded layers) don't darken the rest.
#[must_use]
pub fn feature_range(map: &[f32]) -> [f32; 2] {
    [0.02, 0.98].map(|share| percentile(map, share))
}

/// For every pixel of the picture the two nearest of the map, and the weight of the second, with half-pixel centres.
fn axis(from: usize, to: u32) -> Vec<(usize, usize, f32)> {
    let place = |i: u32| {
        let p = (i as f32 + 0.5) * from as f32 / to as f32 - 0.5;
        let p = p.clamp(0.0, (from - 1) as f32);
        let low = p as usize;
        (low, (low + 1).min(from - 1), p - low as f32)
    };
    (0..to).map(place).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn colours_show_the_map_over_the_grey_picture() {
        let mut picture = RgbImage::from_pixel(8, 4, Rgb([100; 3]));
        picture.put_pixel(0, 3, Rgb([200; 3]));
        let map = [0.0, 1.0, 0.0, 1.0];
        let out = feature_picture(&picture, &map, (2, 2), [0.0, 1.0]).unwrap();
        let [r, _, b] = out.get_pixel(7, 0).0;
        assert!(r > b + 40, "the map's greatest value is red: {r} {b}");
        let [left, right] = [out.get_pixel(0, 0).0, out.get_pixel(0, 3).0];
        for c in 0..3 {
            assert_eq!(right[c] - left[c], 40, "0.4 of the grey shines through");
        }
        // Between the two columns' centres.
        let middle = out.get_pixel(3, 0).0;
        assert!(middle != left && middle != out.get_pixel(7, 0).0);
        assert!(feature_picture(&picture, &map, (3, 2), [0.0, 1.0]).is_err());
        let flat = feature_picture(&picture, &[0.5; 4], (2, 2), feature_range(&[0.5; 4]));
        assert_eq!(flat.unwrap().get_pixel(7, 0), out.get_pixel(0, 0));
    }

    #[test]
    fn a_single_outlier_does_not_set_the_range() {
        let mut map = vec![0.5; 200];
        map[0] = 90.0;
        map[1] = -3.0;
        assert_eq!(feature_range(&map), [0.5, 0.5]);
    }
}
