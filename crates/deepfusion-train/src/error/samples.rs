//! Why there are no training samples, or no view by a second camera.

use deepfusion_hint::count_of;
use std::sync::Arc;

/// A sample is left out if the standard deviation of its distance exceeds this share of the distance: it is too uncertain to teach the
/// scale.
pub(crate) const MOST_SIGMA_SHARE: f64 = 0.2;

/// Why there are no training samples.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum SampleProblem {
    /// The set has no sample.
    #[error("it is empty")]
    Empty,
    /// No drive was given.
    #[error("it has no drive")]
    NoDrive,
    /// All samples are images with known depth, none are from video.
    #[error("nothing is learned from video")]
    NoVideo,
    /// No drive has a sample, for these reasons.
    #[error("{}", .0.iter().map(ToString::to_string).collect::<Vec<_>>().join("; "))]
    Skipped(Vec<Skipped>),
}

/// Why all or some samples of a drive are left out.
#[derive(Debug, Clone, thiserror::Error)]
#[non_exhaustive]
pub enum Skipped {
    /// Samples whose distances are too uncertain to teach the scale.
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
        /// Samples that the drive has, with those.
        of: usize,
    },
    /// Images that cannot be read and are left out.
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
        /// The first of them, each with its error.
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
    /// Number of its other validation targets that are sources of training samples.
    pub sources: usize,
}

/// Why a drive's second camera cannot be used as a view.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[non_exhaustive]
pub enum NoStereo {
    /// No drive of the run has a second camera among the data.
    OneCamera,
    /// The two cameras have no frame of the same moment.
    NoCommonFrame,
    /// The calibration does not contain the cameras' positions.
    NoBaseline,
    /// The images are not rectified: the cameras' intrinsics or orientations differ.
    NotRectified,
}

impl std::fmt::Display for NoStereo {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(match self {
            Self::OneCamera => "neither this drive nor any other has a second camera among the data, and stereo requires one",
            Self::NoCommonFrame => "its two cameras have no frame in common",
            Self::NoBaseline => "the calibration does not contain the positions of its two cameras",
            Self::NotRectified => {
                "its two cameras are not rectified: their intrinsics or orientations differ"
            }
        })
    }
}

/// The first of `broken` images that cannot be read, each with its error, and the number of the others.
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
        let message = |broken, images: &[&str]| {
            let reason = Skipped::BrokenImages {
                drive: "monday".into(),
                broken,
                of: 40,
                images: images.iter().map(|image| (*image).to_owned()).collect(),
            };
            reason.to_string()
        };
        assert_eq!(
            message(1, &["a.png: cut"]),
            "monday: 1 of 40 images cannot be read and is left out: a.png: cut"
        );
        assert_eq!(
            message(5, &["a.png: cut", "b.png: cut"]),
            "monday: 5 of 40 images cannot be read and are left out: a.png: cut; b.png: cut; and 3 more"
        );
    }
}
