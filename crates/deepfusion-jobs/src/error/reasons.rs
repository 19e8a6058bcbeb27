//! In what something differs from what it has to be.

use std::path::{Path, PathBuf};

use deepfusion_geometry::ImplausibleCamera;
use deepfusion_hint::count_of;
use deepfusion_records::Difference;

/// Why what stands beside an image is not this job's.
#[derive(Debug, Clone, PartialEq, Eq)]
#[non_exhaustive]
pub enum StaleReason {
    /// It is no sidecar.
    NoSidecar,
    /// It is of another image.
    OtherImage(PathBuf),
    /// It was made in another way.
    MadeWith(Difference),
    /// The image is another one now.
    ImageChanged(PathBuf),
    /// Its recording has another calibration now.
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

/// In what another job differs.
#[derive(Debug, Clone, PartialEq, Eq)]
#[non_exhaustive]
pub enum OtherJob {
    /// It has other images: so many, and this one so many.
    Inputs(usize, usize),
    /// It makes them in another way.
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

/// Why there is no mean of weights.
#[derive(Debug, Clone, PartialEq, Eq)]
#[non_exhaustive]
pub enum NoMean {
    /// There is no run to put the mean into.
    Packed,
    /// Its depth network never learned.
    EncodersOnly,
    /// It learned its camera, which belongs to its weights.
    LearnedCamera,
    /// A tensor that one network lacks, or that has another shape.
    Layers {
        /// The tensor's name.
        name: String,
    },
    /// A setting by which the same weights mean something else.
    Setting {
        /// The key, or what it is.
        key: String,
        /// Of this network.
        found: String,
        /// Of the first one.
        first: String,
    },
}

impl std::fmt::Display for NoMean {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            Self::Packed => write!(f, "is packed, and the first network must be a run's"),
            Self::EncodersOnly => write!(f, "only its encoders were ever trained"),
            Self::LearnedCamera => write!(
                f,
                "learned its camera with its weights, so that they have no mean with others"
            ),
            Self::Layers { name } => write!(
                f,
                "has other layers than the first network: {name} is not the same in both"
            ),
            Self::Setting { key, found, first } => {
                write!(f, "{key} is {found}, and {first} in the first network")
            }
        }
    }
}

/// Why a camera cannot be an image's.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum UnfitCamera {
    /// No camera is like that.
    #[error(transparent)]
    Implausible(ImplausibleCamera),
    /// It is that of images of another size.
    #[error("{}", other_size(file.as_deref(), *made_for, *image))]
    OtherSize {
        /// The calibration's file, where it is one for a lens.
        file: Option<PathBuf>,
        /// Width and height of its images.
        made_for: (u32, u32),
        /// Those of this one.
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
