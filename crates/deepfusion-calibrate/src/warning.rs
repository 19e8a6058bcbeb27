//! What makes a calibration less sure than it could be.

use crate::Calibration;
use deepfusion_hint::count_of;

/// Below this tilt, in degrees, a board says little of the focal length.
const TILTED_DEG: f64 = 12.0;
/// Views that should be tilted more.
const TILTED_VIEWS: usize = 3;
/// Standard error of the focal length, as a share of it, that is warned of.
const UNSURE: f64 = 0.005;
/// Root mean square error that is warned of, in pixels per 1000 of the image's longer side, and at least in pixels.
const ROUGH_PX: (f64, f64) = (0.5, 0.5);
/// Views that are enough.
const GOOD_VIEWS: usize = 10;

/// What makes a calibration less sure than it could be.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum CalibrationWarning {
    /// The board was seen from few sides.
    #[error(
        "{} {} few: {enough} to 30, from many sides, are better",
        count_of(*used, "view"),
        if *used == 1 { "is" } else { "are" }
    )]
    FewViews {
        /// Views that were used.
        used: usize,
        /// How many are enough.
        enough: usize,
    },
    /// The boards were held nearly parallel to the image.
    #[error(
        "the boards are all but parallel to the image (tilted by {most_deg:.0} degrees at most): the focal length is unsure; tilt the board by 20 to 45 degrees"
    )]
    NotTilted {
        /// The largest tilt of a board, degrees.
        most_deg: f64,
    },
    /// The board was never in these of the image's corners.
    #[error(
        "no corner was seen in the image's {}: the lens is guessed there; show the board there, too",
        .0.join(", ")
    )]
    EmptyCorners(Vec<&'static str>),
    /// The board was never near these of the image's edges; how wide the strip without it is, as a share of the image.
    #[error(
        "no corner was seen in {} of the image: the lens is guessed there; show the board there, too",
        strips(.0)
    )]
    WideMargins(Vec<(&'static str, f64)>),
    /// The focal length has a large standard error.
    #[error(
        "the focal length is known to {:.1} % only: more tilted views, and nearer ones, make it surer",
        100.0 * share
    )]
    UnsureFocalLength {
        /// The standard error, as a share of the focal length.
        share: f64,
    },
    /// The camera explains the corners badly.
    #[error(
        "the corners are {rms_px:.2} px off (root mean square): is the board flat, the picture sharp and unmoved, and the lens model right (fisheye or not)?"
    )]
    LargeError {
        /// Root mean square distance, pixels.
        rms_px: f64,
    },
    /// The lens model ends before the image does.
    #[error(
        "the lens model shows nothing at the image's left or right edge: show the board there, too"
    )]
    NothingAtEdge,
}

fn strips(margins: &[(&str, f64)]) -> String {
    let strips = margins.iter();
    let strips = strips.map(|(edge, share)| format!("the {edge} {:.0} %", 100.0 * share));
    strips.collect::<Vec<_>>().join(", ")
}

impl Calibration {
    /// What makes it less sure than it could be.
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
    fn a_warning_is_said_in_words() {
        let few = |used| CalibrationWarning::FewViews { used, enough: 10 };
        for (warning, said) in [
            (
                few(1),
                "1 view is few: 10 to 30, from many sides, are better",
            ),
            (
                few(6),
                "6 views are few: 10 to 30, from many sides, are better",
            ),
            (
                CalibrationWarning::NotTilted { most_deg: 4.4 },
                "the boards are all but parallel to the image (tilted by 4 degrees at most): the focal length is unsure; tilt the board by 20 to 45 degrees",
            ),
            (
                CalibrationWarning::EmptyCorners(vec!["top left", "bottom right"]),
                "no corner was seen in the image's top left, bottom right: the lens is guessed there; show the board there, too",
            ),
            (
                CalibrationWarning::WideMargins(vec![("left", 0.2), ("top", 0.256)]),
                "no corner was seen in the left 20 %, the top 26 % of the image: the lens is guessed there; show the board there, too",
            ),
            (
                CalibrationWarning::UnsureFocalLength { share: 0.0123 },
                "the focal length is known to 1.2 % only: more tilted views, and nearer ones, make it surer",
            ),
            (
                CalibrationWarning::LargeError { rms_px: 0.806 },
                "the corners are 0.81 px off (root mean square): is the board flat, the picture sharp and unmoved, and the lens model right (fisheye or not)?",
            ),
        ] {
            assert_eq!(warning.to_string(), said);
        }
    }
}
