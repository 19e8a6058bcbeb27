//! Image motion between two frames: shift, drop and roll from the camera's rotation, growth from its forward motion.
//!
//! In the upper part of a road image, turning moves everything by the same amount. Driving moves everything away from the centre, near
//! things more than far ones. All motions are fitted together to a pair of small grey images, coarse to fine, by gradients (Lucas and
//! Kanade 1981; Bergen et al. 1992):
//!
//! I₁(x + s + e·x' − φ·y', y + p + e·y' + φ·x') = I₀(x, y) + β, (x', y') = (x, y) − centre
//!
//! with the shift s to the right and p downward (pixels), the roll φ (clockwise), a growth e (in the last refinement one for each block of
//! the image), and a change of brightness β.

mod align;

use crate::{Error, ExpectedSetting, Result};
use align::Plane;

/// Smallest image that can be aligned, in pixels.
const LEAST: (usize, usize) = (32, 16);

/// A small grey image (some 160×48 pixels are enough), prepared for [`ImageMotion::between`].
#[derive(Debug, Clone)]
pub struct GreyFrame {
    time_s: f64,
    /// Full size first, then successive halves.
    pyramid: Vec<Plane>,
}

impl GreyFrame {
    /// Prepares an image of `width * height` values, row by row, in any unit, taken at `time_s` of the camera's clock.
    ///
    /// # Errors
    /// [`Error::Config`] if the number of values is not `width * height`, or the image is smaller than 32×16.
    pub fn new(time_s: f64, width: usize, height: usize, values: &[f32]) -> Result<Self> {
        if width < LEAST.0 || height < LEAST.1 {
            return Err(Error::Config {
                field: "image size",
                value: width.min(height) as f64,
                expected: ExpectedSetting::PictureSize {
                    width: LEAST.0,
                    height: LEAST.1,
                },
            });
        }
        if width.checked_mul(height) != Some(values.len()) {
            return Err(Error::Config {
                field: "number of pixels",
                value: values.len() as f64,
                expected: ExpectedSetting::AllPixels,
            });
        }
        let mut pyramid = vec![Plane::new(width, height, values)];
        while let Some(half) = pyramid.last().and_then(Plane::half) {
            pyramid.push(half);
        }
        Ok(Self { time_s, pyramid })
    }

    /// Prepares an image of bytes.
    ///
    /// # Errors
    /// As [`GreyFrame::new`].
    pub fn from_bytes(time_s: f64, width: usize, height: usize, bytes: &[u8]) -> Result<Self> {
        let values: Vec<f32> = bytes.iter().map(|b| f32::from(*b)).collect();
        Self::new(time_s, width, height, &values)
    }

    /// Time when it was taken, in seconds of the camera's clock.
    #[must_use]
    pub fn time_s(&self) -> f64 {
        self.time_s
    }
}

/// Image motion between two frames.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ImageMotion {
    /// Time of the earlier frame, in seconds of the camera's clock.
    pub from_s: f64,
    /// Time of the later frame.
    pub to_s: f64,
    /// How far the distant scene moved to the right, in pixels (or any unit): f·Δθ for a camera with focal length f that turned left by Δθ.
    pub shift: f64,
    /// How far the distant scene moved down, in pixels: −f·Δ for a camera whose nose went down by Δ.
    pub drop: f64,
    /// How far the image turned clockwise about its centre, in radians: minus the camera's roll.
    pub clockwise_rad: f64,
    /// Relative growth of the image: about the distance driven divided by the depth of the scene.
    pub growth: f64,
}

impl ImageMotion {
    /// The motion from one frame to the next; `None` if the images differ in size, have no texture (a wall, a tunnel, night), or moved by
    /// more than a quarter of their width.
    #[must_use]
    pub fn between(before: &GreyFrame, after: &GreyFrame) -> Option<Self> {
        let warp = align::align(&before.pyramid, &after.pyramid)?;
        Some(Self {
            from_s: before.time_s,
            to_s: after.time_s,
            shift: warp.right,
            drop: warp.down,
            clockwise_rad: warp.clockwise,
            growth: warp.growth,
        })
    }
}

/// The motions of a sequence of frames: from each frame to the first one at least `apart_s` later, if they can be aligned. About 0.1 s is a
/// good value: over a longer time, errors of the alignment matter less, but the motion may become too large to align.
#[must_use]
pub fn image_motions(frames: &[GreyFrame], apart_s: f64) -> Vec<ImageMotion> {
    let pair = |(i, before): (usize, &GreyFrame)| {
        // Frame times jitter by a share of the interval.
        let far = |after: &&GreyFrame| after.time_s - before.time_s >= apart_s - 1e-3;
        let after = frames[i + 1..].iter().find(far)?;
        ImageMotion::between(before, after)
    };
    frames.iter().enumerate().filter_map(pair).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    const SIZE: (usize, usize) = (160, 48);

    /// A scene of waves, moved to the right and enlarged about the middle of the aligned rows.
    fn picture(right: f64, roll: f64, growth: f64, brightness: f64) -> GreyFrame {
        let centre = align::centre(SIZE.0, SIZE.1);
        let mut values = Vec::new();
        for y in 0..SIZE.1 {
            for x in 0..SIZE.0 {
                let (u, v) = (x as f64 - centre.0 - right, y as f64 - centre.1);
                let (u, v) = (u + roll * v, v - roll * u);
                let (u, v) = (u / (1.0 + growth), v / (1.0 + growth));
                let wave =
                    (0.35 * u).sin() + (0.21 * u + 0.4 * v).cos() + (0.11 * u - 0.3 * v).sin();
                values.push((128.0 + 30.0 * wave + brightness) as f32);
            }
        }
        GreyFrame::new(0.0, SIZE.0, SIZE.1, &values).unwrap()
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(40))]
        #[test]
        fn a_moved_scene_shows_how_it_moved(right in -7.0..7.0f64, roll in -0.02..0.02f64, growth in -0.02..0.05f64, brightness in -20.0..20.0f64) {
            let motion = ImageMotion::between(&picture(0.0, 0.0, 0.0, 0.0), &picture(right, roll, growth, brightness)).unwrap();
            // Bilinear sampling of waves of 16 pixels costs some hundredths of a pixel.
            prop_assert!((motion.shift - right).abs() < 0.06, "{} {right}", motion.shift);
            prop_assert!((motion.clockwise_rad - roll).abs() < 2e-3, "{} {roll}", motion.clockwise_rad);
            prop_assert!((motion.growth - growth).abs() < 2e-3, "{} {growth}", motion.growth);
        }
    }

    #[test]
    fn an_untextured_wall_gives_no_motion() {
        let wall = GreyFrame::from_bytes(0.0, 160, 48, &[90; 160 * 48]).unwrap();
        assert_eq!(ImageMotion::between(&wall, &wall), None);
        assert_eq!(
            ImageMotion::between(&wall, &picture(0.0, 0.0, 0.0, 0.0)),
            None
        );
    }

    #[test]
    fn images_of_wrong_sizes_are_refused() {
        assert!(GreyFrame::from_bytes(0.0, 160, 48, &[0; 100]).is_err());
        assert!(GreyFrame::from_bytes(0.0, 8, 8, &[0; 64]).is_err());
        assert!(GreyFrame::from_bytes(0.0, usize::MAX, 48, &[0; 64]).is_err());
        let small = GreyFrame::from_bytes(0.0, 64, 32, &[7; 64 * 32]).unwrap();
        assert_eq!(
            ImageMotion::between(&small, &picture(0.0, 0.0, 0.0, 0.0)),
            None
        );
        let bad = GreyFrame::new(0.0, 64, 32, &[f32::NAN; 64 * 32]).unwrap();
        assert_eq!(ImageMotion::between(&bad, &bad), None);
    }
}
