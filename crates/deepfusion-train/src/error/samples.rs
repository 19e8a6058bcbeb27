//! Why there is nothing to learn from, or no view by another camera.

use deepfusion_hint::count_of;
use std::sync::Arc;

/// Standard deviation of a distance, as a share of it, above which its sample is left out: metres that unsure teach no scale.
pub(crate) const MOST_SIGMA_SHARE: f64 = 0.2;

/// Why there is nothing to learn from.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum SampleProblem {
    /// A set of samples without one.
    #[error("it is empty")]
    Empty,
    /// No drive was given.
    #[error("it has no drive")]
    NoDrive,
    /// All samples are images of known depth.
    #[error("nothing is learned from video")]
    NoVideo,
    /// What drives there are have no sample.
    #[error("{}", .0.iter().map(ToString::to_string).collect::<Vec<_>>().join("; "))]
    Skipped(Vec<Skipped>),
}

/// Why a drive has no sample, or lacks some.
#[derive(Debug, Clone, thiserror::Error)]
#[non_exhaustive]
pub enum Skipped {
    /// Distances that teach no scale.
    #[error(
        "{drive}: {unsure} of {} {} a distance that is known to no better than {:.0} %",
        count_of(*of, "sample"),
        if *unsure == 1 { "has" } else { "have" },
        100.0 * MOST_SIGMA_SHARE
    )]
    UnsureDistances {
        /// The drive.
        drive: String,
        /// Samples that are left out.
        unsure: usize,
        /// Samples that it has.
        of: usize,
    },
    /// Images that cannot be read, and are done without.
    #[error(
        "{drive}: {broken} of {} cannot be read and {} left out: {}",
        count_of(*of, "image"),
        if *broken == 1 { "is" } else { "are" },
        named(images, *broken)
    )]
    BrokenImages {
        /// The drive.
        drive: String,
        /// How many of its images cannot be read.
        broken: usize,
        /// How many images it has.
        of: usize,
        /// The first of them, each with what is wrong with it.
        images: Vec<String>,
    },
    /// No sample of the drive can be made.
    #[error(transparent)]
    Drive(Arc<deepfusion_data::Error>),
}

/// The validation frames of a drive that training also uses.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct SharedFrames {
    /// The drive.
    pub drive: String,
    /// Number of its validation targets that are also targets of training samples.
    pub targets: usize,
    /// Number of further ones that are sources of training samples.
    pub sources: usize,
}

/// Why a drive's other camera is no view.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[non_exhaustive]
pub enum NoStereo {
    /// No drive of the run has a second one among the data.
    OneCamera,
    /// No frame of the drive has one of the other camera.
    NoCommonFrame,
    /// The calibration does not say where the cameras are.
    NoBaseline,
    /// They see through other lenses, or are turned: their images are not rectified.
    NotRectified,
}

impl std::fmt::Display for NoStereo {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(match self {
            Self::OneCamera => "its other camera is not among the data, nor is that of any other drive, and stereo asks for it",
            Self::NoCommonFrame => "its two cameras have no frame in common",
            Self::NoBaseline => "nothing says where its two cameras are",
            Self::NotRectified => {
                "its two cameras are not rectified: their images have other intrinsics, or are turned"
            }
        })
    }
}

/// The first of so many broken images, each with what is wrong with it.
pub(super) fn named(images: &[String], broken: usize) -> String {
    let mut text = images.join("; ");
    let more = broken.saturating_sub(images.len());
    if more > 0 {
        text += &format!("; and {more} more");
    }
    text
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn broken_images_are_named_or_counted() {
        let said = |broken, images: &[&str]| {
            let reason = Skipped::BrokenImages {
                drive: "monday".into(),
                broken,
                of: 40,
                images: images.iter().map(|image| (*image).to_owned()).collect(),
            };
            reason.to_string()
        };
        assert_eq!(
            said(1, &["a.png: cut"]),
            "monday: 1 of 40 images cannot be read and is left out: a.png: cut"
        );
        assert_eq!(
            said(5, &["a.png: cut", "b.png: cut"]),
            "monday: 5 of 40 images cannot be read and are left out: a.png: cut; b.png: cut; and 3 more"
        );
    }
}
