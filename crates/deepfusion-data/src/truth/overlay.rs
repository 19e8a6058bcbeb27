//! Draws sparse depth on its image, for checking calibration and time stamps by eye.

use crate::{Error, Result};
use deepfusion_geometry::DepthMap;
use image::{Rgb, RgbImage};

/// Depths at the two ends of the colour scale, in metres: red is near, blue is far.
const NEAR_M: f32 = 3.0;
const FAR_M: f32 = 60.0;

/// The image with every depth as a 2×2 dot, coloured by the logarithm of depth from red (near) over yellow and
/// green to blue (far); near dots cover far ones.
///
/// # Errors
/// [`Error::Size`] if the two sizes differ.
pub fn overlay(image: &RgbImage, depth: &DepthMap) -> Result<RgbImage> {
    let size = (depth.width as u32, depth.height as u32);
    if image.dimensions() != size {
        return Err(Error::Size {
            what: "the depth map",
            found: size,
            image: image.dimensions(),
        });
    }
    let mut dots: Vec<(usize, f32)> = depth.data.iter().copied().enumerate().collect();
    dots.retain(|(_, d)| *d > 0.0);
    dots.sort_by(|a, b| b.1.total_cmp(&a.1));
    let mut drawn = image.clone();
    for (i, d) in dots {
        let (x, y) = ((i % depth.width) as u32, (i / depth.width) as u32);
        for (dx, dy) in [(0, 0), (1, 0), (0, 1), (1, 1)] {
            if let Some(pixel) = drawn.get_pixel_mut_checked(x + dx, y + dy) {
                *pixel = colour(d);
            }
        }
    }
    Ok(drawn)
}

/// Hue 0 (red) at [`NEAR_M`] to 240 degrees (blue) at [`FAR_M`].
fn colour(depth_m: f32) -> Rgb<u8> {
    let far = (depth_m / NEAR_M).ln() / (FAR_M / NEAR_M).ln();
    let sixth = far.clamp(0.0, 1.0) * 4.0;
    let ramp = |centre: f32| {
        let value = 2.0 - (sixth - centre).abs();
        (value.clamp(0.0, 1.0) * 255.0).round() as u8
    };
    Rgb([ramp(0.0), ramp(2.0), ramp(4.0)])
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn near_depths_are_red_and_far_ones_blue() {
        let mut depth = DepthMap::empty(8, 4);
        depth.set_nearest(0, 0, 2.0);
        depth.set_nearest(4, 1, 70.0);
        depth.set_nearest(7, 3, 13.0);
        let grey = RgbImage::from_pixel(8, 4, Rgb([90, 90, 90]));
        let drawn = overlay(&grey, &depth).unwrap();
        assert_eq!(drawn.get_pixel(1, 1), &Rgb([255, 0, 0]));
        assert_eq!(drawn.get_pixel(4, 1), &Rgb([0, 0, 255]));
        let [r, g, b] = drawn.get_pixel(7, 3).0;
        assert!(g == 255 && r < 255 && b < 255, "{r} {g} {b}");
        assert_eq!(drawn.get_pixel(2, 3), &Rgb([90, 90, 90]));
    }

    #[test]
    fn a_near_dot_covers_a_far_one() {
        let mut depth = DepthMap::empty(3, 2);
        depth.set_nearest(1, 0, 60.0);
        depth.set_nearest(0, 0, 3.0);
        let drawn = overlay(&RgbImage::new(3, 2), &depth).unwrap();
        assert_eq!(drawn.get_pixel(1, 0), &Rgb([255, 0, 0]));
    }

    #[test]
    fn a_depth_map_of_another_size_is_an_error() {
        let error = overlay(&RgbImage::new(3, 2), &DepthMap::empty(4, 2)).unwrap_err();
        assert!(error.to_string().contains("4x2"), "{error}");
    }
}
