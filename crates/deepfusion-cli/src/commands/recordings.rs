//! Opens recordings and prints their warnings.

use std::path::{Path, PathBuf};

use crate::failure::Result;
use deepfusion_data::{Camera, Cameras, Dataset, OpenOptions};
use deepfusion_jobs::evaluation::{MissingReason, missing_frames};
use deepfusion_jobs::recordings::{self, read_split};
#[cfg(feature = "train")]
use deepfusion_jobs::samples::{self, SampleWarning};
#[cfg(feature = "train")]
use deepfusion_model::TrainConfig;
#[cfg(feature = "train")]
use deepfusion_train::SampleSet;

use super::warnings;

/// Opens the recordings at several paths, each drive and camera as a [`Dataset`].
pub(super) fn open_datasets(
    paths: &[PathBuf],
    split: Option<&Path>,
    camera: Cameras,
) -> Result<Vec<Dataset>> {
    let options = OpenOptions {
        camera,
        split: read_split(split)?,
        ..OpenOptions::default()
    };
    open_recordings(paths, &options)
}

/// As [`open_datasets`], with the given options.
pub(super) fn open_recordings(paths: &[PathBuf], options: &OpenOptions) -> Result<Vec<Dataset>> {
    let datasets = recordings::open_recordings(paths, options)?;
    print_warnings(options, &datasets);
    Ok(datasets)
}

/// As [`open_recordings`], for commands that need the vehicle's motion: if no camera mount is given, it is measured from the images.
pub(super) fn open_aimed(paths: &[PathBuf], options: &OpenOptions) -> Result<Vec<Dataset>> {
    let datasets = recordings::open_aimed(paths, options)?;
    print_warnings(options, &datasets);
    Ok(datasets)
}

/// As [`open_aimed`], for commands that need the vehicle's turns: without a yaw rate, turns are measured from the images.
pub(super) fn open_with_yaw(paths: &[PathBuf], options: &OpenOptions) -> Result<Vec<Dataset>> {
    let datasets = recordings::open_with_yaw(paths, options)?;
    print_warnings(options, &datasets);
    Ok(datasets)
}

/// The training and validation samples of a configuration. Warns of skipped drives, speeds that cannot be in m/s and validation
/// frames that are also used in training.
#[cfg(feature = "train")]
pub(super) fn open_samples(config: &TrainConfig) -> Result<(SampleSet, SampleSet)> {
    let samples = samples::open_samples(config, &mut print_warnings, &mut warn_of_sample);
    Ok(samples?)
}

/// Prints a warning about the samples.
#[cfg(feature = "train")]
pub(super) fn warn_of_sample(warning: SampleWarning) {
    warnings::warn_once(warning.to_string());
}

/// Prints the recordings' warnings, and one if the second camera or frames of the split are missing.
pub(super) fn print_warnings(options: &OpenOptions, datasets: &[Dataset]) {
    warnings::print(datasets);
    if let Some(camera) = only_camera(options, datasets) {
        warnings::warn_once(format!(
            "both cameras are asked for, but only camera {} has images",
            camera.number()
        ));
    }
    if let Some(missing) = missing_frames(options, datasets) {
        warnings::warn_once(match missing.why {
            MissingReason::OtherCamera(_) => format!("{missing}: add --camera both"),
            _ => missing.to_string(),
        });
    }
}

/// The camera of all images, if both cameras are asked for. A split may select the images of one.
fn only_camera(options: &OpenOptions, datasets: &[Dataset]) -> Option<Camera> {
    let first = datasets.first()?.camera();
    let asked = options.camera == Cameras::Both && options.split.is_none();
    let is_only = datasets.iter().all(|dataset| dataset.camera() == first);
    (asked && is_only).then_some(first)
}
