use deepfusion_geometry::DepthMap;
use image::{Rgb, RgbImage, imageops};

use crate::captioned::{INK, PAPER, Tile, sheet};
use crate::colour::NOTHING;
use crate::error::require_size;
use crate::text::{TextSize, draw_text, text_width};
use crate::{ColourMap, DepthScale, Result};

/// Depth in colours, warm near and cold far; dark grey where there is none.
#[must_use]
pub fn depth_picture(depth: &DepthMap, scale: &DepthScale) -> RgbImage {
    from_pixels(depth.width, &depth.data, |d| scale.colour(*d))
}

/// Disparity (any unit, H×W row by row) in magma, bright near: from 0 to its 95th percentile, so that a few near pixels
/// don't darken the rest. Dark grey where it is not finite.
///
/// # Errors
/// [`crate::Error::Size`] unless it has `width * height` values.
pub fn disparity_picture(disparity: &[f32], width: u32, height: u32) -> Result<RgbImage> {
    require_size("disparity", disparity.len(), (width, height))?;
    let high = percentile(disparity, 0.95).max(f32::MIN_POSITIVE);
    Ok(from_pixels(width as usize, disparity, |d| {
        if d.is_finite() {
            ColourMap::Magma.colour(d / high)
        } else {
            NOTHING
        }
    }))
}

/// The picture with a bar of the scale's colours below it, and depths in metres at round places.
#[must_use]
pub fn with_depth_legend(picture: &RgbImage, scale: &DepthScale) -> RgbImage {
    let ticks: Vec<(f32, String)> = scale
        .ticks_m()
        .iter()
        .map(|m| (scale.place(*m), format!("{m} m")))
        .collect();
    let colour = |t: f32| scale.colour(scale.near_m * (scale.far_m / scale.near_m).powf(t));
    with_legend(picture, &colour, &ticks)
}

/// The scale's colour bar alone, with depths in metres.
#[must_use]
pub fn depth_legend(width: u32, scale: &DepthScale) -> RgbImage {
    with_depth_legend(&RgbImage::new(width, 0), scale)
}

/// A colour bar under a picture. `colour` maps [0, 1] to the bar's colours, `ticks` are positions in [0, 1] with labels.
pub(crate) fn with_legend(
    picture: &RgbImage,
    colour: &dyn Fn(f32) -> Rgb<u8>,
    ticks: &[(f32, String)],
) -> RgbImage {
    let (width, height) = picture.dimensions();
    let size = TextSize::for_width(width);
    let (bar, margin) = (size.height() / 2 + 2, size.height() / 2);
    let legend = 4 + bar + 4 + size.height() + 3;
    let mut out = RgbImage::from_pixel(width, height + legend, PAPER);
    imageops::replace(&mut out, picture, 0, 0);
    let length = width.saturating_sub(2 * margin).max(2);
    for x in 0..length.min(width) {
        let pixel = colour(x as f32 / (length - 1) as f32);
        for y in 0..bar {
            out.put_pixel((margin + x).min(width - 1), height + 4 + y, pixel);
        }
    }
    let mut free_from = 0;
    for (place, label) in ticks {
        let x = margin + (place * (length - 1) as f32).round() as u32;
        let half = text_width(label, size) / 2;
        // Labels at the ends are moved inside (pages round a picture's corners); those that would touch their neighbour
        // are left out.
        let inset = size.height() / 2;
        let left = x
            .saturating_sub(half)
            .max(inset)
            .min(width.saturating_sub(2 * half + inset));
        if left < free_from {
            continue;
        }
        free_from = left + 2 * half + size.height() / 2;
        for y in 0..bar + 3 {
            if let Some(pixel) = out.get_pixel_mut_checked(x, height + 4 + y) {
                *pixel = INK;
            }
        }
        draw_text(
            &mut out,
            label,
            (left as i32, (height + 4 + bar + 4) as i32),
            size,
            INK,
        );
    }
    out
}

/// The image and its depth with a legend: side by side, or one above the other if the image is wide.
///
/// # Errors
/// [`crate::Error::Size`] if the depth map's size differs from the image's.
pub fn side_by_side(image: &RgbImage, depth: &DepthMap, scale: &DepthScale) -> Result<RgbImage> {
    let (width, height) = image.dimensions();
    require_size("depth map", depth.data.len(), (width, height))?;
    let tiles = [
        Tile::new("image", image.clone()),
        Tile::new(
            "depth",
            with_depth_legend(&depth_picture(depth, scale), scale),
        ),
    ];
    Ok(sheet(&tiles, if width > 2 * height { 1 } else { 2 }))
}

pub(crate) fn from_pixels<T>(
    width: usize,
    values: &[T],
    colour: impl Fn(&T) -> Rgb<u8>,
) -> RgbImage {
    let height = values.len().checked_div(width).unwrap_or(0);
    let mut out = RgbImage::new(width as u32, height as u32);
    for (pixel, value) in out.pixels_mut().zip(values) {
        *pixel = colour(value);
    }
    out
}

/// The value below which the share `p` of the finite values lies; 0 for none.
pub(crate) fn percentile(values: &[f32], p: f32) -> f32 {
    let mut finite: Vec<f32> = values.iter().copied().filter(|v| v.is_finite()).collect();
    if finite.is_empty() {
        return 0.0;
    }
    let place = ((finite.len() - 1) as f32 * p).round() as usize;
    *finite.select_nth_unstable_by(place, f32::total_cmp).1
}

#[cfg(test)]
mod tests {
    use super::*;

    fn ramp(width: usize, height: usize) -> DepthMap {
        let data = (0..width * height)
            .map(|i| 2.0 + 78.0 * (i % width) as f32 / width as f32)
            .collect();
        DepthMap {
            width,
            height,
            data,
        }
    }

    #[test]
    fn the_picture_is_untouched_above_its_legend() {
        let scale = DepthScale::default();
        let picture = depth_picture(&ramp(300, 40), &scale);
        let out = with_depth_legend(&picture, &scale);
        assert_eq!(out.width(), 300);
        assert!(out.height() > 50);
        assert_eq!(imageops::crop_imm(&out, 0, 0, 300, 40).to_image(), picture);
        // The bar runs from warm to cold; its very ends are under the ticks.
        let ([r, _, b], [end_r, _, end_b]) = (out.get_pixel(8, 47).0, out.get_pixel(292, 47).0);
        assert!(r > b + 100 && end_b > end_r, "{r} {b} {end_r} {end_b}");
    }

    #[test]
    fn tiny_pictures_do_not_break_the_legend() {
        for width in 1..40 {
            let picture = RgbImage::new(width, 3);
            let out = with_depth_legend(&picture, &DepthScale::default());
            assert_eq!(out.width(), width);
        }
    }

    #[test]
    fn wide_images_stand_above_their_depth() {
        let wide = side_by_side(
            &RgbImage::new(120, 40),
            &ramp(120, 40),
            &DepthScale::default(),
        )
        .unwrap();
        assert!(wide.width() < 140);
        let square = side_by_side(
            &RgbImage::new(40, 40),
            &ramp(40, 40),
            &DepthScale::default(),
        )
        .unwrap();
        assert!(square.width() > 80);
        assert!(
            side_by_side(
                &RgbImage::new(40, 41),
                &ramp(40, 40),
                &DepthScale::default()
            )
            .is_err()
        );
        assert!(disparity_picture(&[0.5; 7], 2, 3).is_err());
    }
}
