//! Warnings about a calibration: it is inaccurate, or applies to other images than one may think.

use deepfusion_calibrate::{Board, CalibrationWarning};
use deepfusion_data::NoLens;

/// Largest side of a board's squares, in metres, that gives no warning.
const LARGEST_SQUARE_M: f64 = 0.5;

/// A warning about a calibration: it is inaccurate, or applies to other images than one may think.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum BoardWarning {
    /// A warning of the calibration itself.
    #[error(transparent)]
    Calibration(#[from] CalibrationWarning),
    /// Pictures were turned upright, and the calibration is for upright ones.
    #[error(
        "EXIF turns the pictures by {}: the calibration is for upright pictures, {}x{}, as used for single pictures; images of recordings are used as stored",
        turned(*orientation), size.0, size.1
    )]
    Turned {
        /// EXIF's number for the orientation of the pictures.
        orientation: u8,
        /// Width and height of the upright pictures.
        size: (u32, u32),
    },
    /// The given squares are larger than anybody prints them.
    #[error(
        "squares of {square_m} m: expected the side in metres, not millimetres (25 mm is 0.025 m)"
    )]
    LargeSquares {
        /// The side of a square, metres.
        square_m: f64,
    },
    /// Images cannot be corrected with the lens.
    #[error(
        "images cannot be corrected with this lens: {0}; show the board closer to the border of the image"
    )]
    NotCorrectable(#[source] NoLens),
}

impl BoardWarning {
    /// A warning if a board's squares are so large that their side was probably not given in metres.
    pub(super) fn of_squares(board: &Board) -> Option<Self> {
        let square_m = board.square_m.filter(|side| *side > LARGEST_SQUARE_M)?;
        Some(Self::LargeSquares { square_m })
    }
}

/// How EXIF's orientation turns a picture.
pub(super) fn turned(orientation: u8) -> &'static str {
    match orientation {
        1 => "0 degrees",
        3 => "180 degrees",
        6 => "90 degrees",
        8 => "270 degrees",
        _ => "a mirror",
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn warnings_have_the_expected_text() {
        let few = CalibrationWarning::FewViews {
            used: 6,
            enough: 10,
        };
        let (orientation, size) = (6, (480, 640));
        for (warning, expected) in [
            (
                BoardWarning::from(few),
                "only 6 views: 10 to 30, from many sides, are better",
            ),
            (
                BoardWarning::Turned { orientation, size },
                "EXIF turns the pictures by 90 degrees: the calibration is for upright pictures, 480x640, as used for single pictures; images of recordings are used as stored",
            ),
            (
                BoardWarning::LargeSquares { square_m: 25.0 },
                "squares of 25 m: expected the side in metres, not millimetres (25 mm is 0.025 m)",
            ),
            (
                BoardWarning::NotCorrectable(NoLens::FoldsOver),
                "images cannot be corrected with this lens: the distortion folds over within the image: it does not fit this camera matrix; show the board closer to the border of the image",
            ),
        ] {
            assert_eq!(warning.to_string(), expected);
        }
    }

    #[test]
    fn only_implausibly_large_squares_give_a_warning() {
        let warned = |side: Option<f64>| {
            let board = Board::new(9, 6, side).unwrap();
            BoardWarning::of_squares(&board).is_some()
        };
        assert!(warned(Some(25.0)) && warned(Some(0.6)));
        assert!(!warned(Some(0.5)) && !warned(Some(0.025)) && !warned(None));
    }
}
