//! Why a camera's calibration cannot be used.

use super::calibration_file::CalibrationFileProblem;
use deepfusion_geometry::{ImplausibleCamera, NoDistortion};
use deepfusion_hint::Hint;
use std::path::PathBuf;

/// Why a camera's calibration cannot be used.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum CameraProblem {
    /// The file is none that a calibration tool writes.
    #[error(transparent)]
    File(#[from] CalibrationFileProblem),
    /// The numbers make no camera of images of this size.
    #[error(transparent)]
    Implausible(#[from] ImplausibleCamera),
    /// Matrix and distortion do not fit each other.
    #[error(transparent)]
    Lens(#[from] NoLens),
    /// A bag's camera, from whatever says it, cannot be used.
    #[error(transparent)]
    CameraInfo(#[from] CameraInfoProblem),
    /// A recording's images were taken with different focal lengths.
    #[error("EXIF says {said}, but {other_said} in {other}")]
    Zoomed {
        /// By what this image says it.
        said: String,
        /// By what the other one does.
        other_said: String,
        /// The other one's name.
        other: String,
    },
    /// A calibration of raw images for a topic of rectified ones.
    #[error(
        "it has a distortion, and the images are of a topic with `rect` in its name, rectified already"
    )]
    Rectified {
        /// The file beside the bag, which names both.
        config: PathBuf,
    },
    /// The images of a scene have several cameras.
    #[error("{scene}: its images have several calibrations of {camera}")]
    Several {
        /// The scene.
        scene: String,
        /// The camera's name.
        camera: &'static str,
    },
    /// A GoPro's video does not say how wide its linear lens saw.
    #[error(
        "filmed through the linear lens of a {model}, but zoomed or cut to another shape: how wide it sees is not known"
    )]
    LinearZoomed {
        /// The GoPro's model.
        model: String,
    },
    /// A GoPro's video was filmed through a lens that is no pinhole's.
    #[error(
        "the video says that its lens was \"{lens}\" on a {model}, which bends lines as no pinhole does"
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
            Self::Implausible(_) => "give the calibration of these images, in their own pixels",
            Self::Lens(problem) => return problem.hint().unwrap_or_default(),
            Self::CameraInfo(CameraInfoProblem::NoProjection) => {
                "name the raw images' topic (topics.image), or give the rectified camera as [camera], in the file beside the bag"
            }
            Self::CameraInfo(_) => "calibrate the camera at the size of these images",
            Self::Zoomed { .. } => {
                "a recording has one camera: keep apart what was taken with another lens or zoom, or give a calibration"
            }
            Self::Rectified { config } => {
                return format!(
                    "name the raw images' topic (topics.image), or give the rectified camera as [camera], both in {}",
                    config.display()
                );
            }
            Self::Several { .. } => "a scene has one camera: leave it out",
            Self::LinearZoomed { .. } => {
                "calibrate the camera as it was zoomed; calibration.yaml beside the video then says it"
            }
            Self::BendsLines { .. } => {
                let lens = Self::OTHER_LENS;
                return format!("{lens}; calibration.yaml beside the video then says it");
            }
        };
        text.to_owned()
    }
}

/// Why a bag's camera, from whatever says it, cannot be used.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum CameraInfoProblem {
    /// A model of lenses that is not known.
    #[error(
        "distortion_model {name} is not known: plumb_bob, rational_polynomial and equidistant are"
    )]
    Model {
        /// Its name.
        name: String,
    },
    /// Its images are rectified, and it says the camera of the others alone.
    #[error("its images are rectified and its P is 0; K and D are of the images before that")]
    NoProjection,
    /// The coefficients are no lens's.
    #[error(transparent)]
    Coefficients(#[from] NoDistortion),
    /// Matrix and distortion do not fit each other.
    #[error(transparent)]
    Lens(#[from] NoLens),
}

/// Why a distortion does not fit a camera.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum NoLens {
    /// It shows one place twice.
    #[error("the distortion folds over within the image: it does not fit this camera matrix")]
    FoldsOver,
    /// What is left after it is no camera's.
    #[error("after correction {0}")]
    Implausible(#[from] ImplausibleCamera),
}

impl Hint for NoLens {
    fn hint(&self) -> Option<String> {
        Some("take matrix and coefficients from one calibration, for images of this size".into())
    }
}
