//! The samples that a configuration is trained and validated with.

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

/// Something that training goes on with, and that may not be meant.
#[derive(Debug, Clone)]
#[non_exhaustive]
pub enum SampleWarning {
    /// Drives whose camera or turns are wrong.
    Fault(Fault),
    /// The speeds of a drive, by its name, do not fit its images.
    Speed(String, SpeedWarning),
    /// A drive that gives no samples, or fewer, and why.
    Skipped(Skipped),
    /// Images of a drive that cannot be read, and are done without.
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
                "{drive}: 1 of its validation frames is a neighbour of training frames, and was seen as such"
            ),
            Self::Neighbours(shared) => write!(
                f,
                "{}: {} of its validation frames are neighbours of training frames, and were seen as such",
                shared.drive, shared.sources
            ),
        }
    }
}

impl From<Skipped> for SampleWarning {
    fn from(reason: Skipped) -> Self {
        match reason {
            // Their drive is learned from.
            Skipped::BrokenImages { .. } => Self::BrokenImages(reason),
            _ => Self::Skipped(reason),
        }
    }
}

/// The training and validation samples of a configuration; `opened` sees the recordings of each set, with how they were opened,
/// `warn` what should be known before training.
///
/// # Errors
/// Recordings that cannot be opened, and what [`SampleSet::split_sets`] says.
pub fn open_samples(
    config: &TrainConfig,
    opened: &mut dyn FnMut(&OpenOptions, &[Dataset]),
    warn: &mut dyn FnMut(SampleWarning),
) -> Result<(SampleSet, SampleSet)> {
    let train = open_for(config, RecordingRole::Training, opened)?;
    let mut known = HashSet::new();
    // Both cameras of a drive have one speed.
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
        // The check is a service: what is really wrong with the images, training will say.
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
