//! Why a calibration file's text is no camera.

use deepfusion_geometry::NoDistortion;
use deepfusion_hint::count_of;

/// Why a calibration file's text is no camera.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum CalibrationFileProblem {
    /// A word is not a number.
    #[error("'{text}' is not a number")]
    NotANumber {
        /// The word, or its beginning.
        text: String,
    },
    /// It has more numbers than a matrix.
    #[error("more than nine numbers")]
    TooManyNumbers,
    /// It has nine numbers, which make no camera matrix.
    #[error("nine numbers, but no camera matrix fx 0 cx 0 fy cy 0 0 1")]
    NotAMatrix,
    /// It has neither four nor nine numbers.
    #[error("{}, expected four (fx, fy, cx, cy) or a matrix of nine", count_of(*found, "number"))]
    Numbers {
        /// How many it has.
        found: usize,
    },
    /// It is longer than any calibration.
    #[error("too long for a calibration")]
    TooLong,
    /// It is no YAML, or that of something else.
    // No source: the first line of what the parser says is enough, and a source would say all of it.
    #[error("not the YAML of a calibration: {}", .0.to_string().lines().next().unwrap_or_default())]
    Yaml(Box<serde_saphyr::Error>),
    /// Kalibr's camchain has no camera.
    #[error("the camchain is empty")]
    NoCamera,
    /// It has no matrix.
    #[error("it has no camera_matrix (nor K)")]
    NoMatrix,
    /// Its matrix is no camera's.
    #[error("camera_matrix: expected the nine numbers fx, 0, cx, 0, fy, cy, 0, 0, 1")]
    Matrix,
    /// Its pixels are no rectangles.
    #[error("camera_matrix: a skew is not supported")]
    Skew,
    /// Kalibr's intrinsics are not four.
    #[error("intrinsics: {}, expected fx, fy, cx, cy", count_of(*found, "number"))]
    Intrinsics {
        /// How many there are.
        found: usize,
    },
    /// A matrix has not the size that it says.
    #[error("{field}: {}, but its rows and cols make {said}", count_of(*found, "number"))]
    MatrixSize {
        /// The matrix.
        field: &'static str,
        /// How many numbers it has.
        found: usize,
        /// How many it says.
        said: u64,
    },
    /// The coefficients are no lens's.
    #[error("distortion coefficients: {0}")]
    Coefficients(#[from] NoDistortion),
    /// A model of lenses that is not known.
    #[error("the lens model '{name}' is not supported")]
    Model {
        /// Its name, or the beginning.
        name: String,
    },
}

impl CalibrationFileProblem {
    pub(crate) fn hint(&self) -> &'static str {
        match self {
            Self::Model { .. } => {
                "calibrate with Brown and Conrady's model (OpenCV's default, ROS plumb_bob or \
                 rational_polynomial, Kalibr pinhole-radtan), of a fisheye lens with Kannala and Brandt's (cv::fisheye, \
                 Kalibr pinhole-equi), or undistort the images first"
            }
            _ => {
                concat!(
                    "OpenCV's and ROS's calibration YAML, Kalibr's camchain and four numbers fx, fy, cx, cy are read: ",
                    env!("CARGO_PKG_REPOSITORY"),
                    "/blob/main/docs/guides/train-on-your-own-video.md"
                )
            }
        }
    }
}
