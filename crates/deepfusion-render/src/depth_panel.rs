use image::RgbImage;

use crate::captioned::{Tile, sheet};
use crate::colour::NOTHING;
use crate::depth_picture::{disparity_picture, from_pixels};
use crate::error::require_size;
use crate::panel::picture_from_chw;
use crate::{ColourMap, Result};

/// An error by this factor, up or down, has the strongest colour.
const WORST_FACTOR: f32 = 1.5;

/// Input and output of a training step for one image with known depth: planes of `width` × `height`, row by row.
#[derive(Debug, Clone, Copy)]
pub struct DepthPanel<'a> {
    /// Width, in pixels.
    pub width: u32,
    /// Height, in pixels.
    pub height: u32,
    /// The image as the network saw it, 3×H×W in [0, 1].
    pub image: &'a [f32],
    /// The network's disparity, H×W.
    pub disparity: &'a [f32],
    /// The true disparity, H×W, NaN where unknown.
    pub truth: &'a [f32],
    /// ln of predicted over true depth, H×W, 0 where the truth is unknown.
    pub error: &'a [f32],
}

/// Image, both disparities, and the error (red: too far, blue: too near) with their captions.
///
/// # Errors
/// [`crate::Error::Size`] naming the part whose size differs from the image's.
pub fn depth_panel(panel: &DepthPanel<'_>) -> Result<RgbImage> {
    let size @ (width, height) = (panel.width, panel.height);
    require_size("error", panel.error.len(), size)?;
    require_size("true disparity", panel.truth.len(), size)?;
    let known = panel.truth.iter().filter(|t| t.is_finite()).count();
    let mean = panel.error.iter().map(|e| e.abs()).sum::<f32>() / known.max(1) as f32;
    let places: Vec<usize> = (0..panel.error.len()).collect();
    let error = |i: &usize| {
        if panel.truth[*i].is_finite() {
            ColourMap::Diverging.colour(0.5 + 0.5 * panel.error[*i] / WORST_FACTOR.ln())
        } else {
            NOTHING
        }
    };
    let tiles = [
        Tile::new("image", picture_from_chw("image", panel.image, size)?),
        Tile::new(
            "disparity",
            disparity_picture(panel.disparity, width, height)?,
        ),
        Tile::new(
            "true disparity",
            disparity_picture(panel.truth, width, height)?,
        ),
        Tile::new(
            format!("log error, mean {mean:.3}"),
            from_pixels(width as usize, &places, error),
        ),
    ];
    Ok(sheet(&tiles, 2))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn unknown_depth_is_grey_and_a_wrong_size_is_named() {
        let (three, one) = ([0.25; 96], [0.5; 32]);
        let mut truth = one;
        truth[0] = f32::NAN;
        let panel = DepthPanel {
            width: 8,
            height: 4,
            image: &three,
            disparity: &one,
            truth: &truth,
            error: &[0.0; 32],
        };
        let drawn = depth_panel(&panel).unwrap();
        assert!(drawn.pixels().any(|p| *p == NOTHING));
        let short = DepthPanel {
            truth: &truth[1..],
            ..panel
        };
        let error = depth_panel(&short).unwrap_err().to_string();
        assert!(error.contains("true disparity"), "{error}");
    }
}
