//! The recordings that a configuration names.

use std::path::{Path, PathBuf};

use deepfusion_data::{Camera, Cameras, Dataset, NamedTopic, OpenOptions, Split};
use deepfusion_model::{DataSetConfig, Error as ModelError, TrainConfig};

use crate::Result;

/// Opens the recordings at several paths, each drive and camera a data set.
///
/// # Errors
/// A path that holds no recording, or a broken one.
pub fn open_recordings(paths: &[PathBuf], options: &OpenOptions) -> Result<Vec<Dataset>> {
    let mut datasets = Vec::new();
    for path in paths {
        datasets.extend(Dataset::open(path, options)?);
    }
    Ok(datasets)
}

/// The split file of a name, read.
///
/// # Errors
/// A file that is no split.
pub fn read_split(path: Option<&Path>) -> Result<Option<Split>> {
    Ok(path.map(Split::read).transpose()?)
}

/// Cameras as configurations name them.
#[must_use]
pub fn camera_word(camera: Cameras) -> &'static str {
    match camera.cameras() {
        [Camera::Left] => "2",
        [Camera::Right] => "3",
        _ => "both",
    }
}

/// All recordings to train on, with the place of their set in `data.sets`.
///
/// # Errors
/// As [`open_recordings`].
pub fn training_recordings(config: &TrainConfig) -> Result<Vec<(usize, Dataset)>> {
    open_for(config, RecordingRole::Training, &mut |_, _| ())
}

/// What recordings are for.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum RecordingRole {
    /// To learn from.
    Training,
    /// To judge by.
    Validation,
}

/// Whether there are recordings or frames to validate on; else the end of each drive is held out.
#[must_use]
pub fn validates(config: &TrainConfig) -> bool {
    let data = &config.data;
    let own = !data.validation.is_empty() || data.validation_split.is_some();
    own || data.sets.iter().any(DataSetConfig::validates)
}

/// The recordings for training or validation, with the place of their set in `data.sets`; `opened` sees those of each set, with how they were
/// opened.
///
/// # Errors
/// As [`open_recordings`].
pub fn open_for(
    config: &TrainConfig,
    role: RecordingRole,
    opened: &mut dyn FnMut(&OpenOptions, &[Dataset]),
) -> Result<Vec<(usize, Dataset)>> {
    let data = &config.data;
    if data.sets.is_empty() {
        let validation = (&data.validation, &data.validation_split);
        let (paths, split) = of_role(role, (&data.paths, &data.split), validation);
        let options = open_options(
            config,
            split,
            &data.camera,
            data.camera_ahead_s,
            &data.topics,
        )?;
        let datasets = open_recordings(paths, &options)?;
        opened(&options, &datasets);
        return Ok(placed(0, datasets));
    }
    let mut all = Vec::new();
    for (i, set) in data.sets.iter().enumerate() {
        let validation = (&set.validation, &set.validation_split);
        let (paths, split) = of_role(role, (&set.paths, &set.split), validation);
        let camera = match set.camera.as_str() {
            "" => &data.camera,
            own => own,
        };
        let ahead_s = set.camera_ahead_s.or(data.camera_ahead_s);
        let topics = match set.topics.as_slice() {
            [] => &data.topics,
            _ => &set.topics,
        };
        let options = open_options(config, split, camera, ahead_s, topics)?;
        let datasets = open_recordings(paths, &options)?;
        opened(&options, &datasets);
        all.extend(placed(i, datasets));
    }
    Ok(all)
}

/// Paths and the split file that selects their frames.
type Frames<'a> = (&'a Vec<PathBuf>, &'a Option<PathBuf>);

/// Those for one role. A split of training frames says nothing about which to validate on, nor the other way round.
fn of_role<'a>(
    role: RecordingRole,
    training: Frames<'a>,
    validation: Frames<'a>,
) -> (&'a [PathBuf], Option<&'a Path>) {
    let (paths, split) = match role {
        RecordingRole::Training => training,
        RecordingRole::Validation if validation.0.is_empty() => (training.0, validation.1),
        RecordingRole::Validation => validation,
    };
    (paths, split.as_deref())
}

/// Each with the place of its set.
fn placed(set: usize, datasets: Vec<Dataset>) -> Vec<(usize, Dataset)> {
    datasets.into_iter().map(|d| (set, d)).collect()
}

/// Topics as configurations name them.
///
/// # Errors
/// One that is not written as [`NamedTopic`].
pub fn named_topics(topics: &[String]) -> Result<Vec<NamedTopic>> {
    let read = |text: &String| {
        text.parse().map_err(|expected| {
            ModelError::Config {
                field: "data.topics",
                expected,
                found: text.clone(),
            }
            .into()
        })
    };
    topics.iter().map(read).collect()
}

/// How a configuration wants recordings opened: by its words for cameras and topics.
fn open_options(
    config: &TrainConfig,
    split: Option<&Path>,
    camera: &str,
    camera_ahead_s: Option<f64>,
    topics: &[String],
) -> Result<OpenOptions> {
    let camera: Cameras = match camera {
        "" => Cameras::default(),
        text => text.parse().map_err(|_| ModelError::Config {
            field: "data.camera",
            expected: "2, 3 or both".into(),
            found: text.into(),
        })?,
    };
    Ok(OpenOptions {
        camera,
        split: read_split(split)?,
        camera_ahead_s,
        topics: named_topics(topics)?,
        assumed_camera: config.assumed_camera.map(|camera| camera.intrinsics()),
        ..OpenOptions::default()
    })
}
