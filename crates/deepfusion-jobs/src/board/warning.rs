//! What makes a camera by a board's pictures less sure, or of other images than one may think.

use deepfusion_calibrate::CalibrationWarning;
use deepfusion_data::NoLens;

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
    /// Images cannot be corrected with the lens.
    #[error(
        "images cannot be corrected with this lens: {0}; show the board nearer to the image's border"
    )]
    NotCorrectable(#[source] NoLens),
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
                "6 views are few: 10 to 30, from many sides, are better",
            ),
            (
                BoardWarning::Turned { orientation, size },
                "EXIF turns the pictures by 90 degrees: the calibration is of the upright ones, 480x640, which a network sees where it is given the pictures alone; a recording's images are used as they are stored",
            ),
            (
                BoardWarning::NotCorrectable(NoLens::FoldsOver),
                "images cannot be corrected with this lens: the distortion folds over within the image: it does not fit this camera matrix; show the board nearer to the image's border",
            ),
        ] {
            assert_eq!(warning.to_string(), said);
        }
    }
}
