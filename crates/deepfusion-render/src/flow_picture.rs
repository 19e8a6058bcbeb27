use image::{Rgb, RgbImage};

use crate::Result;
use crate::depth_picture::{from_pixels, percentile};
use crate::error::require_size;

/// An optical flow in the usual colours: the hue is the direction (red to the right, then yellow, green, blue
/// clockwise), the saturation the length, full at the 98th percentile. White means no motion.
///
/// Returns the picture and the length of full saturation, in pixels.
///
/// # Errors
/// [`crate::Error::Size`] if `flow` is not 2×H×W.
pub fn flow_picture(flow: &[f32], width: u32, height: u32) -> Result<(RgbImage, f32)> {
    require_size("flow", flow.len(), (2 * width, height))?;
    let (u, v) = flow.split_at(flow.len() / 2);
    let lengths: Vec<f32> = u.iter().zip(v).map(|(u, v)| u.hypot(*v)).collect();
    let full = percentile(&lengths, 0.98).max(1e-3);
    let places: Vec<usize> = (0..lengths.len()).collect();
    let picture = from_pixels(width as usize, &places, |i| {
        let turn = v[*i].atan2(u[*i]) / std::f32::consts::TAU;
        let saturation = (lengths[*i] / full).clamp(0.0, 1.0);
        bright(turn.rem_euclid(1.0), saturation)
    });
    Ok((picture, full))
}

/// The brightest colour of a hue, in turns from red over yellow, with a saturation.
fn bright(hue: f32, saturation: f32) -> Rgb<u8> {
    Rgb([0.0, 1.0 / 3.0, 2.0 / 3.0].map(|of| {
        let away = (hue - of).abs();
        let away = away.min(1.0 - away) * 6.0;
        let pure = (2.0 - away).clamp(0.0, 1.0);
        ((1.0 - saturation * (1.0 - pure)) * 255.0).round() as u8
    }))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_hue_is_the_direction_and_white_means_no_motion() {
        // Right, down, left, and no motion.
        let flow = [4.0, 0.0, -4.0, 0.0, 0.0, 4.0, 0.0, 0.0];
        let (picture, full) = flow_picture(&flow, 4, 1).unwrap();
        assert!((full - 4.0).abs() < 1e-6, "{full}");
        assert_eq!(picture.get_pixel(0, 0).0, [255, 0, 0]);
        // A quarter turn from red lies between yellow and green.
        let [r, g, b] = picture.get_pixel(1, 0).0;
        assert!(g == 255 && (120..136).contains(&r) && b == 0, "{r} {g} {b}");
        assert_eq!(picture.get_pixel(2, 0).0, [0, 255, 255]);
        assert_eq!(picture.get_pixel(3, 0).0, [255, 255, 255]);
        assert!(flow_picture(&flow[1..], 4, 1).is_err());
    }
}
