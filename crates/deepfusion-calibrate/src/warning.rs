//! Warnings about a calibration that could be more accurate.

use crate::Calibration;
use deepfusion_hint::count_of;

/// A board with less tilt than this, in degrees, says little about the focal length.
const TILTED_DEG: f64 = 12.0;
/// Number of views that should have more tilt.
const TILTED_VIEWS: usize = 3;
/// A greater relative standard error of the focal length causes a warning.
const UNSURE: f64 = 0.005;
/// A greater root mean square error causes a warning: in pixels per 1000 of the image's longer side, and in pixels.
const ROUGH_PX: (f64, f64) = (0.5, 0.5);
/// Enough views.
const GOOD_VIEWS: usize = 10;

/// A warning about a calibration that could be more accurate.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum CalibrationWarning {
    /// The board was seen from few sides.
    #[error(
        "only {}: {enough} to 30, from many sides, are better",
        count_of(*used, "view")
    )]
    FewViews {
        /// Number of views used.
        used: usize,
        /// Number of views that is enough.
        enough: usize,
    },
    /// The boards were held nearly parallel to the image.
    #[error(
        "the boards are nearly parallel to the image (tilted by at most {most_deg:.0} degrees): the focal length is uncertain; tilt the board by 20 to 45 degrees"
    )]
    NotTilted {
        /// The largest tilt of a board, degrees.
        most_deg: f64,
    },
    /// The board was never in these corners of the image.
    #[error(
        "no board corner was seen in the image's {}: the lens is extrapolated there; show the board there too",
        .0.join(", ")
    )]
    EmptyCorners(Vec<&'static str>),
    /// The board was never near these edges of the image; each with the width of the strip, as a share of the image.
    #[error(
        "no board corner was seen in {} of the image: the lens is extrapolated there; show the board there too",
        strips(.0)
    )]
    WideMargins(Vec<(&'static str, f64)>),
    /// The focal length has a large standard error.
    #[error(
        "the standard error of the focal length is {:.1} %: add nearer and more tilted views",
        100.0 * share
    )]
    UnsureFocalLength {
        /// The standard error, as a share of the focal length.
        share: f64,
    },
    /// The corners fit the camera badly.
    #[error(
        "the corners are off by {rms_px:.2} px (root mean square): check that the board is flat, the pictures are sharp, and the lens model is right (fisheye or not)"
    )]
    LargeError {
        /// Root mean square error of the corners, pixels.
        rms_px: f64,
    },
    /// The lens model has no rays at an edge of the image.
    #[error(
        "the lens model has no rays at the image's left or right edge: show the board there too"
    )]
    NothingAtEdge,
}

fn strips(margins: &[(&str, f64)]) -> String {
    let strips = margins.iter();
    let strips = strips.map(|(edge, share)| format!("the {edge} {:.0} %", 100.0 * share));
    strips.collect::<Vec<_>>().join(", ")
}

impl Calibration {
    /// The warnings about this calibration.
    #[must_use]
    pub fn warnings(&self) -> Vec<CalibrationWarning> {
        let mut warnings = Vec::new();
        let used = self.used();
        if used < GOOD_VIEWS {
            warnings.push(CalibrationWarning::FewViews {
                used,
                enough: GOOD_VIEWS,
            });
        }
        let tilts: Vec<f64> = self
            .views
            .iter()
            .filter(|v| v.used)
            .filter_map(|v| v.tilt_deg)
            .collect();
        let tilted = tilts.iter().filter(|t| **t > TILTED_DEG).count();
        if tilted < TILTED_VIEWS {
            let most_deg = tilts.iter().copied().fold(0.0, f64::max);
            warnings.push(CalibrationWarning::NotTilted { most_deg });
        }
        let (empty, margins) = (self.coverage.empty_corners(), self.coverage.wide_margins());
        if !empty.is_empty() {
            warnings.push(CalibrationWarning::EmptyCorners(empty));
        } else if !margins.is_empty() {
            warnings.push(CalibrationWarning::WideMargins(margins));
        }
        let k = &self.intrinsics;
        let share = (self.standard_errors.fx / k.fx).max(self.standard_errors.fy / k.fy);
        if share > UNSURE {
            warnings.push(CalibrationWarning::UnsureFocalLength { share });
        }
        let side = f64::from(k.width.max(k.height)) / 1000.0;
        if self.rms_px > (ROUGH_PX.0 * side).max(ROUGH_PX.1) {
            let rms_px = self.rms_px;
            warnings.push(CalibrationWarning::LargeError { rms_px });
        }
        if self.hfov_deg.is_none() {
            warnings.push(CalibrationWarning::NothingAtEdge);
        }
        warnings
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn warnings_have_their_messages() {
        let few = |used| CalibrationWarning::FewViews { used, enough: 10 };
        for (warning, message) in [
            (few(1), "only 1 view: 10 to 30, from many sides, are better"),
            (
                few(6),
                "only 6 views: 10 to 30, from many sides, are better",
            ),
            (
                CalibrationWarning::NotTilted { most_deg: 4.4 },
                "the boards are nearly parallel to the image (tilted by at most 4 degrees): the focal length is uncertain; tilt the board by 20 to 45 degrees",
            ),
            (
                CalibrationWarning::EmptyCorners(vec!["top left", "bottom right"]),
                "no board corner was seen in the image's top left, bottom right: the lens is extrapolated there; show the board there too",
            ),
            (
                CalibrationWarning::WideMargins(vec![("left", 0.2), ("top", 0.256)]),
                "no board corner was seen in the left 20 %, the top 26 % of the image: the lens is extrapolated there; show the board there too",
            ),
            (
                CalibrationWarning::UnsureFocalLength { share: 0.0123 },
                "the standard error of the focal length is 1.2 %: add nearer and more tilted views",
            ),
            (
                CalibrationWarning::LargeError { rms_px: 0.806 },
                "the corners are off by 0.81 px (root mean square): check that the board is flat, the pictures are sharp, and the lens model is right (fisheye or not)",
            ),
        ] {
            assert_eq!(warning.to_string(), message);
        }
    }
}
