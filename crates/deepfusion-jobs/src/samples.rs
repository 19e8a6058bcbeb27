//! The samples that a configuration is trained and validated on.

use std::collections::HashSet;
use std::fmt;

use deepfusion_data::{Dataset, OpenOptions, SpeedWarning, speed_unit_warning};
use deepfusion_model::TrainConfig;
use deepfusion_train::{SampleSet, SharedFrames, Skipped, shared_frames};

use crate::Result;
use crate::recordings::{RecordingRole, open_for, validates};

mod faults;

pub use self::faults::Fault;
use self::faults::faults;

/// A problem that does not stop training, but may not be intended.
#[derive(Debug, Clone)]
#[non_exhaustive]
pub enum SampleWarning {
    /// Drives with a wrong camera or wrong turns.
    Fault(Fault),
    /// The speeds of a drive, by its name, do not match its images.
    Speed(String, SpeedWarning),
    /// A drive that gives no samples, or fewer, with the reason.
    Skipped(Skipped),
    /// Images of a drive that cannot be read and are left out.
    BrokenImages(Skipped),
    /// Validation frames that are sources of training samples.
    Neighbours(SharedFrames),
}

impl fmt::Display for SampleWarning {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Fault(fault) => write!(f, "{fault}"),
            Self::Speed(drive, warning) => write!(f, "{drive}: {warning}"),
            Self::Skipped(reason) => write!(f, "skipped: {reason}"),
            Self::BrokenImages(reason) => write!(f, "{reason}"),
            Self::Neighbours(SharedFrames {
                drive, sources: 1, ..
            }) => write!(
                f,
                "{drive}: 1 validation frame is a neighbour of training frames and was seen in training"
            ),
            Self::Neighbours(shared) => write!(
                f,
                "{}: {} validation frames are neighbours of training frames and were seen in training",
                shared.drive, shared.sources
            ),
        }
    }
}

impl From<Skipped> for SampleWarning {
    fn from(reason: Skipped) -> Self {
        match reason {
            // The drive itself is used.
            Skipped::BrokenImages { .. } => Self::BrokenImages(reason),
            _ => Self::Skipped(reason),
        }
    }
}

/// The training and validation samples of a configuration. `opened` is called with the recordings of each set and the options they were
/// opened with, `warn` with each problem to know before training.
///
/// # Errors
/// Recordings that cannot be opened; an error of [`SampleSet::split_sets`].
pub fn open_samples(
    config: &TrainConfig,
    opened: &mut dyn FnMut(&OpenOptions, &[Dataset]),
    warn: &mut dyn FnMut(SampleWarning),
) -> Result<(SampleSet, SampleSet)> {
    let train = open_for(config, RecordingRole::Training, opened)?;
    let mut known = HashSet::new();
    // Both cameras of a drive have the same speed.
    let is_new = |(_, dataset): &&(usize, Dataset)| {
        known.insert((dataset.place().to_owned(), dataset.name().to_owned()))
    };
    let drives: Vec<&(usize, Dataset)> = train.iter().filter(is_new).collect();
    faults(config, &drives)
        .into_iter()
        .map(SampleWarning::Fault)
        .for_each(&mut *warn);
    for (_, dataset) in drives {
        if let Some(warning) = speed_warning(dataset) {
            warn(SampleWarning::Speed(dataset.name().to_owned(), warning));
        }
    }
    let validation = if validates(config) {
        Some(open_for(config, RecordingRole::Validation, opened)?)
    } else {
        None
    };
    let apart = validation.is_some();
    let (train, validation, skipped) = SampleSet::split_sets(config, train, validation)?;
    skipped
        .into_iter()
        .map(SampleWarning::from)
        .for_each(&mut *warn);
    if apart {
        let shared = shared_frames(&train, &validation);
        shared
            .into_iter()
            .map(SampleWarning::Neighbours)
            .for_each(warn);
    }
    Ok((train, validation))
}

fn speed_warning(dataset: &Dataset) -> Option<SpeedWarning> {
    speed_unit_warning(dataset).unwrap_or_else(|error| {
        // The check is optional: training reports images that cannot be read.
        tracing::debug!("speed check of {}: {error}", dataset.name());
        None
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_drive_with_a_broken_image_is_not_skipped() {
        let reason = Skipped::BrokenImages {
            drive: "monday".into(),
            broken: 1,
            of: 40,
            images: vec!["a.png: cut".into()],
        };
        let warning = SampleWarning::from(reason.clone());
        assert!(matches!(warning, SampleWarning::BrokenImages(_)));
        assert_eq!(warning.to_string(), reason.to_string());
    }
}
