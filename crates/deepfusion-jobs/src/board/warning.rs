//! What makes a camera by a board's pictures less sure, or of other images than one may think.

use deepfusion_calibrate::{Board, CalibrationWarning};
use deepfusion_data::NoLens;

/// The longest side of a board's squares, in metres, that is taken without a word.
const LARGEST_SQUARE_M: f64 = 0.5;

/// What makes a camera by a board's pictures less sure, or of other images than one may think.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum BoardWarning {
    /// What the calibration says of itself.
    #[error(transparent)]
    Calibration(#[from] CalibrationWarning),
    /// Pictures were turned upright, which the calibration then is of.
    #[error(
        "EXIF turns the pictures by {}: the calibration is of the upright ones, {}x{}, which a network sees where it is given the pictures alone; a recording's images are used as they are stored",
        turned(*orientation), size.0, size.1
    )]
    Turned {
        /// How they were, by EXIF's number.
        orientation: u8,
        /// Width and height of the upright ones.
        size: (u32, u32),
    },
    /// The squares are said to be larger than anybody prints them.
    #[error("squares of {square_m} m: their side is in metres, not millimetres; 25 mm are 0.025 m")]
    LargeSquares {
        /// The side of a square, metres.
        square_m: f64,
    },
    /// Images cannot be corrected with the lens.
    #[error(
        "images cannot be corrected with this lens: {0}; show the board nearer to the image's border"
    )]
    NotCorrectable(#[source] NoLens),
}

impl BoardWarning {
    /// Where a board's squares are so large that their side was hardly meant in metres.
    pub(super) fn of_squares(board: &Board) -> Option<Self> {
        let square_m = board.square_m.filter(|side| *side > LARGEST_SQUARE_M)?;
        Some(Self::LargeSquares { square_m })
    }
}

/// What EXIF's orientation does to a picture.
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
    fn a_warning_is_said_in_words() {
        let few = CalibrationWarning::FewViews {
            used: 6,
            enough: 10,
        };
        let (orientation, size) = (6, (480, 640));
        for (warning, said) in [
            (
                BoardWarning::from(few),
                "only 6 views: 10 to 30, from many sides, are better",
            ),
            (
                BoardWarning::Turned { orientation, size },
                "EXIF turns the pictures by 90 degrees: the calibration is of the upright ones, 480x640, which a network sees where it is given the pictures alone; a recording's images are used as they are stored",
            ),
            (
                BoardWarning::LargeSquares { square_m: 25.0 },
                "squares of 25 m: their side is in metres, not millimetres; 25 mm are 0.025 m",
            ),
            (
                BoardWarning::NotCorrectable(NoLens::FoldsOver),
                "images cannot be corrected with this lens: the distortion folds over within the image: it does not fit this camera matrix; show the board nearer to the image's border",
            ),
        ] {
            assert_eq!(warning.to_string(), said);
        }
    }

    #[test]
    fn only_squares_that_nobody_prints_are_warned_of() {
        let warned = |side: Option<f64>| {
            let board = Board::new(9, 6, side).unwrap();
            BoardWarning::of_squares(&board).is_some()
        };
        assert!(warned(Some(25.0)) && warned(Some(0.6)));
        assert!(!warned(Some(0.5)) && !warned(Some(0.025)) && !warned(None));
    }
}
