//! Why a calibration file cannot be used.

use deepfusion_geometry::NoDistortion;
use deepfusion_hint::count_of;

/// Why a calibration file cannot be used.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum CalibrationFileProblem {
    /// A word is not a number.
    #[error("'{text}' is not a number")]
    NotANumber {
        /// The word, or its beginning.
        text: String,
    },
    /// The file has more numbers than a camera matrix.
    #[error("more than nine numbers")]
    TooManyNumbers,
    /// The nine numbers of the file are not a camera matrix.
    #[error("nine numbers, but not of the form fx 0 cx 0 fy cy 0 0 1")]
    NotAMatrix,
    /// The file has neither four nor nine numbers.
    #[error("{}, expected four (fx, fy, cx, cy) or a matrix of nine", count_of(*found, "number"))]
    Numbers {
        /// How many numbers it has.
        found: usize,
    },
    /// The file is longer than any calibration.
    #[error("too long for a calibration")]
    TooLong,
    /// The file is not YAML, or not a calibration.
    // No source: the first line of the parser's message is enough, and a source would print all of it.
    #[error("not the YAML of a calibration: {}", .0.to_string().lines().next().unwrap_or_default())]
    Yaml(Box<serde_saphyr::Error>),
    /// Kalibr's camchain contains no camera.
    #[error("the camchain is empty")]
    NoCamera,
    /// The file has no camera matrix.
    #[error("no camera_matrix or K")]
    NoMatrix,
    /// Its matrix is not a camera matrix.
    #[error("camera_matrix: expected the nine numbers fx, 0, cx, 0, fy, cy, 0, 0, 1")]
    Matrix,
    /// Its matrix has a skew: pixels that are not rectangles.
    #[error("camera_matrix: a skew is not supported")]
    Skew,
    /// Kalibr's intrinsics are not four numbers.
    #[error("intrinsics: {}, expected fx, fy, cx, cy", count_of(*found, "number"))]
    Intrinsics {
        /// How many numbers there are.
        found: usize,
    },
    /// A matrix's length differs from its `rows` times `cols`.
    #[error("{field}: {}, but its rows and cols make {expected}", count_of(*found, "number"))]
    MatrixSize {
        /// The matrix's field.
        field: &'static str,
        /// How many numbers it has.
        found: usize,
        /// `rows` times `cols`.
        expected: u64,
    },
    /// The distortion coefficients are invalid.
    #[error("distortion coefficients: {0}")]
    Coefficients(#[from] NoDistortion),
    /// The lens model is unknown.
    #[error("the lens model '{name}' is not supported")]
    Model {
        /// Its name, or the beginning of it.
        name: String,
    },
}

impl CalibrationFileProblem {
    pub(crate) fn hint(&self) -> &'static str {
        match self {
            Self::Model { .. } => {
                "calibrate with the Brown-Conrady model (OpenCV's default, ROS plumb_bob or rational_polynomial, Kalibr \
                 pinhole-radtan), a fisheye lens with the Kannala-Brandt model (cv::fisheye, Kalibr pinhole-equi), or undistort the images \
                 first"
            }
            _ => {
                concat!(
                    "use calibration YAML of OpenCV or ROS, Kalibr's camchain, or four numbers fx, fy, cx, cy: ",
                    env!("CARGO_PKG_REPOSITORY"),
                    "/blob/main/docs/guides/train-on-your-own-video.md"
                )
            }
        }
    }
}
