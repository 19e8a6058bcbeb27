use deepfusion_geometry::DepthMap;
use image::{Rgb, RgbImage};

use crate::depth_picture::with_legend;
use crate::error::require_size;
use crate::{ColourMap, DepthScale, Result};

/// Relative error at the ends of the colour scale.
const END: f32 = 0.3;

/// Signed relative error (prediction − truth) / truth where there is ground truth, drawn on the darkened image with a
/// legend. Blue: the prediction is too near; red: too far; white: correct; ±30 % at the ends. Dots grow with the
/// image, since ground truth is sparse.
///
/// # Errors
/// [`crate::Error::Size`] if a map's size differs from the image's.
pub fn error_picture(
    image: &RgbImage,
    prediction: &DepthMap,
    ground_truth: &DepthMap,
) -> Result<RgbImage> {
    let (width, height) = image.dimensions();
    require_size("prediction", prediction.data.len(), (width, height))?;
    require_size("ground truth", ground_truth.data.len(), (width, height))?;
    let out = dots(image, ground_truth, |i, truth| {
        let pred = prediction.data[i];
        (pred > 0.0).then(|| colour((pred - truth) / truth / END / 2.0 + 0.5))
    });
    let ticks: Vec<(f32, String)> = [-END, -END / 2.0, 0.0, END / 2.0, END]
        .iter()
        .map(|e| {
            let label = match *e {
                e if e <= -END => "-30 % too near".to_owned(),
                e if e >= END => "too far +30 %".to_owned(),
                0.0 => "0 %".to_owned(),
                e => format!("{:+.0} %", e * 100.0),
            };
            (e / END / 2.0 + 0.5, label)
        })
        .collect();
    Ok(with_legend(&out, &colour, &ticks))
}

/// Sparse depth in colours on the darkened image, without a legend; dots as in [`error_picture`].
///
/// # Errors
/// [`crate::Error::Size`] if the map's size differs from the image's.
pub fn sparse_depth_picture(
    image: &RgbImage,
    depth: &DepthMap,
    scale: &DepthScale,
) -> Result<RgbImage> {
    require_size("depth map", depth.data.len(), image.dimensions())?;
    Ok(dots(image, depth, |_, metres| Some(scale.colour(metres))))
}

/// The darkened image with a dot for each pixel with ground truth for which `colour` (of its index and depth) gives one.
fn dots(
    image: &RgbImage,
    ground_truth: &DepthMap,
    colour: impl Fn(usize, f32) -> Option<Rgb<u8>>,
) -> RgbImage {
    let width = image.width();
    let mut out = image.clone();
    for pixel in out.pixels_mut() {
        let [r, g, b] = pixel.0.map(u32::from);
        let grey = ((r * 77 + g * 150 + b * 29) >> 8) as u8 / 3;
        *pixel = Rgb([grey; 3]);
    }
    // Dense truth needs no dots larger than a pixel.
    let dense = ground_truth.count() * 2 > ground_truth.data.len();
    let dot = if dense { 1 } else { (width / 400).max(2) };
    for (i, &truth) in ground_truth.data.iter().enumerate() {
        if truth > 0.0
            && let Some(colour) = colour(i, truth)
        {
            let (x, y) = ((i % width as usize) as u32, (i / width as usize) as u32);
            for (dx, dy) in (0..dot).flat_map(|dx| (0..dot).map(move |dy| (dx, dy))) {
                if let Some(pixel) = out.get_pixel_mut_checked(x + dx, y + dy) {
                    *pixel = colour;
                }
            }
        }
    }
    out
}

fn colour(t: f32) -> Rgb<u8> {
    ColourMap::Diverging.colour(t)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn too_near_is_blue_too_far_is_red() {
        let truth = DepthMap {
            width: 3,
            height: 1,
            data: vec![10.0, 10.0, 10.0],
        };
        let pred = DepthMap {
            width: 3,
            height: 1,
            data: vec![8.0, 10.0, 12.0],
        };
        let out = error_picture(&RgbImage::new(3, 1), &pred, &truth).unwrap();
        let [r, _, b] = out.get_pixel(0, 0).0;
        assert!(b > r + 50);
        assert!(out.get_pixel(1, 0).0.iter().all(|c| *c > 230));
        let [r, _, b] = out.get_pixel(2, 0).0;
        assert!(r > b + 50);
        assert!(error_picture(&RgbImage::new(2, 1), &pred, &truth).is_err());
    }
}
