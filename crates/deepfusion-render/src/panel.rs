use image::{Rgb, RgbImage};

use crate::captioned::{Tile, sheet};
use crate::depth_picture::{disparity_picture, from_pixels, percentile};
use crate::error::require_size;
use crate::flow_picture::flow_picture;
use crate::{ColourMap, Result};

/// Input and output of a training step for one pair: planes of `width` × `height`, row by row.
#[derive(Debug, Clone, Copy)]
pub struct SamplePanel<'a> {
    /// Width, in pixels.
    pub width: u32,
    /// Height, in pixels.
    pub height: u32,
    /// The target frame, 3×H×W in [0, 1].
    pub image: &'a [f32],
    /// Its disparity, H×W.
    pub disparity: &'a [f32],
    /// The source frame warped onto the target, 3×H×W in [0, 1].
    pub warped: &'a [f32],
    /// The photometric error of the warped frame, H×W.
    pub error: &'a [f32],
    /// Weight of each pixel's warp in the loss, H×W: 1 used, 0 masked out.
    pub mask: &'a [f32],
    /// The optical flow to the source, 2×H×W in pixels, if one is learned.
    pub flow: Option<&'a [f32]>,
    /// 1 where a pixel counts as dynamic, H×W, if such pixels are masked.
    pub moving: Option<&'a [f32]>,
}

/// Image, disparity, warped source, error and mask (red: dynamic) with their captions, and the flow if there is one,
/// for watching a training run.
///
/// # Errors
/// [`crate::Error::Size`] naming the part whose size differs from the image's.
pub fn sample_panel(panel: &SamplePanel<'_>) -> Result<RgbImage> {
    let size @ (width, height) = (panel.width, panel.height);
    require_size("photometric error", panel.error.len(), size)?;
    require_size("mask", panel.mask.len(), size)?;
    let worst = percentile(panel.error, 0.98).max(f32::MIN_POSITIVE);
    let moves = |i: usize| panel.moving.is_some_and(|moving| moving[i] > 0.5);
    if let Some(moving) = panel.moving {
        require_size("moving pixels", moving.len(), size)?;
    }
    let masked = |i: &usize| {
        if moves(*i) {
            Rgb([200, 30, 30])
        } else {
            Rgb([(panel.mask[*i].clamp(0.0, 1.0) * 255.0) as u8; 3])
        }
    };
    let places: Vec<usize> = (0..panel.mask.len()).collect();
    let mut tiles = vec![
        Tile::new("image", picture_from_chw("image", panel.image, size)?),
        Tile::new(
            "disparity",
            disparity_picture(panel.disparity, width, height)?,
        ),
        Tile::new(
            "warped source",
            picture_from_chw("warped source", panel.warped, size)?,
        ),
        Tile::new(
            format!("photometric error, mean {:.3}", mean(panel.error)),
            from_pixels(width as usize, panel.error, |e| {
                ColourMap::Magma.colour(e / worst)
            }),
        ),
        Tile::new(
            match panel.moving {
                Some(moving) => format!(
                    "mask, {:.0} % counts, {:.1} % moves",
                    100.0 * mean(panel.mask),
                    100.0 * mean(moving)
                ),
                None => format!("mask, {:.0} % counts", 100.0 * mean(panel.mask)),
            },
            from_pixels(width as usize, &places, masked),
        ),
    ];
    if let Some(flow) = panel.flow {
        let (picture, full) = flow_picture(flow, width, height)?;
        tiles.push(Tile::new(format!("flow, up to {full:.1} pixels"), picture));
    }
    Ok(sheet(&tiles, if width > 2 * height { 2 } else { 3 }))
}

/// 3×H×W numbers in [0, 1] as a picture.
pub(crate) fn picture_from_chw(
    what: &'static str,
    chw: &[f32],
    (width, height): (u32, u32),
) -> Result<RgbImage> {
    let plane = width as usize * height as usize;
    require_size(what, chw.len(), (3 * width, height))?;
    let places: Vec<usize> = (0..plane).collect();
    let byte = |v: f32| (v.clamp(0.0, 1.0) * 255.0).round() as u8;
    Ok(from_pixels(width as usize, &places, |i| {
        Rgb([
            byte(chw[*i]),
            byte(chw[plane + i]),
            byte(chw[2 * plane + i]),
        ])
    }))
}

fn mean(values: &[f32]) -> f32 {
    values.iter().sum::<f32>() / values.len().max(1) as f32
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn parts_with_a_wrong_size_are_named() {
        let (three, one) = ([0.25; 96], [0.5; 32]);
        let panel = SamplePanel {
            width: 8,
            height: 4,
            image: &three,
            disparity: &one,
            warped: &three,
            error: &one,
            mask: &one,
            flow: None,
            moving: None,
        };
        let drawn = sample_panel(&panel).unwrap();
        assert!(drawn.pixels().any(|p| p.0 == [64; 3]), "the image is there");
        let message = |panel: SamplePanel<'_>| sample_panel(&panel).unwrap_err().to_string();
        assert!(
            message(SamplePanel {
                image: &one,
                ..panel
            })
            .contains("image")
        );
        assert!(
            message(SamplePanel {
                warped: &one,
                ..panel
            })
            .contains("warped")
        );
        assert!(
            message(SamplePanel {
                mask: &one[1..],
                ..panel
            })
            .contains("mask")
        );
        assert!(
            message(SamplePanel {
                error: &one[1..],
                ..panel
            })
            .contains("error")
        );
        assert!(
            message(SamplePanel {
                disparity: &one[1..],
                ..panel
            })
            .contains("disparity")
        );
        let (short, two) = (&one[1..], [2.0; 64]);
        let flow = |flow| SamplePanel {
            flow: Some(flow),
            ..panel
        };
        assert!(message(flow(short)).contains("flow"));
        let moving = |moving| SamplePanel {
            moving: Some(moving),
            ..flow(&two)
        };
        assert!(message(moving(short)).contains("moving"));
        let drawn = sample_panel(&moving(&[1.0; 32])).unwrap();
        assert!(
            drawn.pixels().any(|p| p.0 == [200, 30, 30]),
            "dynamic pixels are red"
        );
        assert!(
            drawn.pixels().any(|p| p.0[0] == 255 && p.0[2] == 0),
            "the flow has colours"
        );
    }
}
