//! Checks before a run begins, and what is found in its samples.

use super::validation::no_samples;
use crate::{Error, SampleSet, TrainConfig, TrainWarning, ViewMotion};
use burn::tensor::Device;
use deepfusion_model::{SetFindings, TrainFindings};
use deepfusion_nn::ops::{Precision, supports};
use std::collections::{BTreeMap, BTreeSet};

/// Focal lengths that differ by less than this share count as the same: those of KITTI's recording days are within 1 %.
const FOCAL_TOLERANCE: f64 = 0.02;

/// Metres per unit of PoseNet's translation; 1 without video, where it does not matter.
fn first_unit(config: &TrainConfig, set: &SampleSet) -> f64 {
    if set.samples.is_empty() {
        1.0
    } else {
        config.first_unit(set.mean_displacement_m())
    }
}

/// What is found in the training samples: their cameras, and the units that the configuration leaves open.
pub(super) fn findings(config: &TrainConfig, train: &SampleSet) -> TrainFindings {
    let unit = |set: f64, samples: &SampleSet| (set == 0.0).then(|| first_unit(config, samples));
    let sets = config.data.sets.iter().enumerate().map(|(i, set)| {
        let own = train.of_set(i);
        SetFindings {
            name: set.name.clone(),
            metres_per_unit: unit(set.metres_per_unit, &own),
            camera: own.camera(),
        }
    });
    TrainFindings {
        focal_px: found_focal_px(config, train),
        metres_per_unit: unit(config.pose_net.metres_per_unit, train),
        camera: train.camera(),
        learned_camera: None,
        sets: sets.collect(),
        averaged: Vec::new(),
    }
}

/// The canonical focal length if the configuration names none: that of the first sample, if focal lengths differ. Predictions then use the
/// first camera, as in any run. `None` with `data.sets`, where predictions use the camera of one of the sets.
fn found_focal_px(config: &TrainConfig, train: &SampleSet) -> Option<f64> {
    let open = config.canonical_focal_px.is_none() && config.data.sets.is_empty();
    let first = train.focal_lengths_px(config).next()?.1;
    (open && has_several_focal_lengths(config, train)).then_some(first)
}

/// Whether the same size in pixels can mean different depths, so that the network's metres must refer to one focal length: cameras of one
/// data set differ, images are cropped or shown at several sizes, or simulated cameras are drawn at random.
fn has_several_focal_lengths(config: &TrainConfig, train: &SampleSet) -> bool {
    let augmented = config.augmentation.zoom > 1.0 || !config.augmentation.sizes.is_empty();
    if !train.depth.is_empty() && (augmented || train.depth.draws_cameras()) {
        return true;
    }
    let mut sets: BTreeMap<usize, f64> = BTreeMap::new();
    train.focal_lengths_px(config).any(|(set, fy)| {
        let first = *sets.entry(set).or_insert(fy);
        (fy / first - 1.0).abs() > FOCAL_TOLERANCE
    })
}

/// The warning about a data set with several focal lengths and no canonical one.
pub(super) fn focal_warning(config: &TrainConfig, train: &SampleSet) -> Option<TrainWarning> {
    let several = config.canonical_focal_px.is_none() && has_several_focal_lengths(config, train);
    several.then_some(TrainWarning::SeveralFocalLengths)
}

/// # Errors
/// [`Error::Precision`] for a number format that the device does not support.
pub(super) fn check_precision(config: &TrainConfig, device: &Device) -> Result<(), Error> {
    if supports(device, config.precision) {
        return Ok(());
    }
    Err(Error::Precision {
        found: match config.precision {
            Precision::F32 => "f32",
            Precision::Bf16 => "bf16",
        },
    })
}

/// # Errors
/// [`Error::NoSamples`] without training samples, [`Error::NoValidation`] if samples should be held out and none are.
pub(super) fn check_samples(
    config: &TrainConfig,
    train: &SampleSet,
    validation: &SampleSet,
) -> Result<(), Error> {
    if train.is_empty() {
        return Err(no_samples("the training data"));
    }
    if validation.is_empty() && config.validation_share > 0.0 {
        return Err(Error::NoValidation);
    }
    Ok(())
}

impl SampleSet {
    /// The names of the drives with video samples whose turns are not known, in the order of their recordings.
    #[must_use]
    pub fn without_turns(&self) -> Vec<&str> {
        let used: BTreeSet<usize> = self.samples.iter().map(|s| s.dataset).collect();
        let drives = used
            .into_iter()
            .filter_map(|dataset| self.datasets.get(dataset));
        drives
            .filter(|drive| !drive.yaw_known())
            .map(deepfusion_data::Dataset::name)
            .collect()
    }
}

/// The warning, with `auto`, about drives that are warped by PoseNet's turns.
pub(super) fn turns_warning(config: &TrainConfig, samples: &SampleSet) -> Option<TrainWarning> {
    if config.view_motion != ViewMotion::Auto {
        return None;
    }
    let drives = samples.without_turns();
    let (first, others) = drives.split_first()?;
    Some(TrainWarning::NoTurns {
        drive: (*first).to_owned(),
        others: others.len(),
    })
}
