//! Why a camera's calibration cannot be used.

use super::calibration_file::CalibrationFileProblem;
use deepfusion_geometry::{ImplausibleCamera, NoDistortion};
use deepfusion_hint::Hint;
use std::path::PathBuf;

/// Why a camera's calibration cannot be used.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum CameraProblem {
    /// The calibration file cannot be read.
    #[error(transparent)]
    File(#[from] CalibrationFileProblem),
    /// The intrinsics are implausible for images of this size.
    #[error(transparent)]
    Implausible(#[from] ImplausibleCamera),
    /// Camera matrix and distortion do not fit each other.
    #[error(transparent)]
    Lens(#[from] NoLens),
    /// A bag's camera calibration cannot be used.
    #[error(transparent)]
    CameraInfo(#[from] CameraInfoProblem),
    /// A recording's images were taken with different focal lengths.
    #[error("EXIF says {entry}, but {other_entry} in {other}")]
    Zoomed {
        /// This image's EXIF entry about its focal length.
        entry: String,
        /// The other image's entry.
        other_entry: String,
        /// The other image's name.
        other: String,
    },
    /// The calibration is for raw images, but the topic has rectified ones.
    #[error(
        "it has distortion coefficients, but the images are already rectified (their topic has `rect` in its name)"
    )]
    Rectified {
        /// Path of the file beside the bag, which names calibration and topic.
        config: PathBuf,
    },
    /// The images of a scene have several calibrations.
    #[error("{scene}: its images have several calibrations of {camera}")]
    Several {
        /// Name of the scene.
        scene: String,
        /// The camera's name.
        camera: &'static str,
    },
    /// A GoPro's video was filmed through the linear lens with a zoom or crop of unknown field of view.
    #[error(
        "filmed through the linear lens of a {model}, but zoomed or cropped: its field of view is unknown"
    )]
    LinearZoomed {
        /// The GoPro's model.
        model: String,
    },
    /// A GoPro's video was filmed through a lens that is not a pinhole camera's.
    #[error(
        "according to the video, it was filmed through the lens \"{lens}\" of a {model}, which bends lines, unlike a pinhole camera"
    )]
    BendsLines {
        /// The lens, as the GoPro's menu calls it.
        lens: String,
        /// The GoPro's model.
        model: String,
    },
}

impl CameraProblem {
    /// What to do about a lens that bends lines.
    pub(crate) const OTHER_LENS: &str =
        "film through the linear lens, or calibrate this one as a fisheye lens";

    /// What to do about it.
    pub(super) fn hint(&self) -> String {
        let text = match self {
            Self::File(problem) => problem.hint(),
            Self::Implausible(_) => "give the calibration of these images, in their pixels",
            Self::Lens(problem) => return problem.hint().unwrap_or_default(),
            Self::CameraInfo(CameraInfoProblem::NoProjection) => {
                "set topics.image to the raw images' topic, or describe the rectified camera under [camera], in the file beside the bag"
            }
            Self::CameraInfo(_) => "calibrate the camera at the size of these images",
            Self::Zoomed { .. } => {
                "keep images taken with different lenses or zooms in separate recordings, or give a calibration"
            }
            Self::Rectified { config } => {
                return format!(
                    "set topics.image to the raw images' topic, or describe the rectified camera under [camera], in {}",
                    config.display()
                );
            }
            Self::Several { .. } => "leave out the scene: it must have a single camera",
            Self::LinearZoomed { .. } => {
                "calibrate the camera with the same zoom, and put calibration.yaml beside the video"
            }
            Self::BendsLines { .. } => {
                let lens = Self::OTHER_LENS;
                return format!("{lens} (calibration.yaml beside the video)");
            }
        };
        text.to_owned()
    }
}

/// Why a bag's camera calibration cannot be used.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum CameraInfoProblem {
    /// The lens model is unknown.
    #[error("distortion_model is {name}, expected plumb_bob, rational_polynomial or equidistant")]
    Model {
        /// Its name.
        name: String,
    },
    /// The images are rectified, but only the camera of the raw ones is given.
    #[error("its images are rectified, but P is 0; K and D only describe the raw images")]
    NoProjection,
    /// The distortion coefficients are invalid.
    #[error(transparent)]
    Coefficients(#[from] NoDistortion),
    /// Camera matrix and distortion do not fit each other.
    #[error(transparent)]
    Lens(#[from] NoLens),
}

/// Why a distortion does not fit a camera.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum NoLens {
    /// The distortion maps two viewing rays to one pixel.
    #[error("the distortion folds over within the image: it does not fit this camera matrix")]
    FoldsOver,
    /// After correction, the intrinsics are implausible.
    #[error("after correction: {0}")]
    Implausible(#[from] ImplausibleCamera),
}

impl Hint for NoLens {
    fn hint(&self) -> Option<String> {
        Some("take matrix and coefficients from one calibration, for images of this size".into())
    }
}
