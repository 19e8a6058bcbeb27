//! Why existing outputs, networks or cameras do not match what is needed.

use std::path::{Path, PathBuf};

use deepfusion_geometry::ImplausibleCamera;
use deepfusion_hint::count_of;
use deepfusion_records::Difference;

/// Why an existing output is not this job's.
#[derive(Debug, Clone, PartialEq, Eq)]
#[non_exhaustive]
pub enum StaleReason {
    /// It is not a sidecar.
    NoSidecar,
    /// It was made from another image.
    OtherImage(PathBuf),
    /// It was made with other settings.
    MadeWith(Difference),
    /// The image has changed since.
    ImageChanged(PathBuf),
    /// The calibration of its recording has changed since.
    Calibration,
}

impl std::fmt::Display for StaleReason {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            Self::NoSidecar => write!(f, "and does not say how it was made"),
            Self::OtherImage(image) => write!(f, "made from {}", image.display()),
            Self::MadeWith(what) => write!(f, "made with {what}"),
            Self::Calibration => write!(f, "made with another calibration of its recording"),
            Self::ImageChanged(image) => write!(f, "and {} has changed since", image.display()),
        }
    }
}

/// How another job differs.
#[derive(Debug, Clone, PartialEq, Eq)]
#[non_exhaustive]
pub enum OtherJob {
    /// It has other images; their number, and the number of this job's images.
    Inputs(usize, usize),
    /// It has other settings.
    MadeWith(Difference),
}

impl std::fmt::Display for OtherJob {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            Self::Inputs(others, ours) => {
                write!(f, "{}, not these {ours}", count_of(*others, "other input"))
            }
            Self::MadeWith(what) => write!(f, "{what}"),
        }
    }
}

/// Why weights cannot be averaged.
#[derive(Debug, Clone, PartialEq, Eq)]
#[non_exhaustive]
pub enum NoMean {
    /// The first network is not a run, so there is nothing to take settings from.
    Packed,
    /// Its depth network was never trained.
    EncodersOnly,
    /// It learned its camera together with its weights.
    LearnedCamera,
    /// A tensor that one network lacks, or whose shape differs.
    Layers {
        /// The tensor's name.
        name: String,
    },
    /// A setting that gives the weights another meaning.
    Setting {
        /// The setting's key or description.
        key: String,
        /// The value in this network.
        found: String,
        /// The value in the first network.
        first: String,
    },
}

impl std::fmt::Display for NoMean {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            Self::Packed => write!(f, "is packed, expected a run as the first network"),
            Self::EncodersOnly => write!(f, "only its encoders were trained"),
            Self::LearnedCamera => write!(
                f,
                "learned its camera together with its weights, so they cannot be averaged with others"
            ),
            Self::Layers { name } => write!(
                f,
                "its layers differ from those of the first network: {name} is not the same in both"
            ),
            Self::Setting { key, found, first } => {
                write!(f, "{key} is {found}, but {first} in the first network")
            }
        }
    }
}

/// Why a camera does not fit an image.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum UnfitCamera {
    /// The intrinsics are implausible for any camera.
    #[error(transparent)]
    Implausible(ImplausibleCamera),
    /// The camera is calibrated for images of another size.
    #[error("{}", other_size(file.as_deref(), *made_for, *image))]
    OtherSize {
        /// Path of the calibration's file, if it contains a lens.
        file: Option<PathBuf>,
        /// Width and height of the calibration's images.
        made_for: (u32, u32),
        /// Width and height of this image.
        image: (u32, u32),
    },
}

fn other_size(file: Option<&Path>, made_for: (u32, u32), image: (u32, u32)) -> String {
    let ((width, height), (w, h)) = (made_for, image);
    match file {
        None => format!("the calibration is for {width}x{height}, the image has {w}x{h}"),
        Some(file) => format!(
            "{} is for images of {width}x{height}, this one has {w}x{h}",
            file.display()
        ),
    }
}
