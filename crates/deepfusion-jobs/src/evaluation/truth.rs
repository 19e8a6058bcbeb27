//! Where the true depth comes from, of which pixels of a prediction it is known, and the mean depth of scans as a baseline.

use std::collections::HashMap;
use std::ops::Range;
use std::path::Path;

use deepfusion_data::{Dataset, GtKind};
use deepfusion_eval::{ArraySet, Grid, MeanDepthBaseline};
use deepfusion_geometry::DepthMap;
use deepfusion_model::TrainConfig;
use deepfusion_runtime::Prediction;

use crate::recordings::training_recordings;
use crate::{Error, Result};

/// Pixels taken of each frame by [`known_pixels`], at most.
const PIXELS: usize = 4_000;

/// Where the truth comes from.
pub enum Truth {
    /// The recordings' scans.
    Scans(GtKind),
    /// A file of arrays that are named as `data export-gt` names them.
    Arrays(Box<ArraySet>),
}

impl Truth {
    /// Of a frame; `place` is where an array file has it. `None` where nothing is known of the frame.
    ///
    /// # Errors
    /// A scan or an array that cannot be read.
    pub fn of(
        &mut self,
        dataset: &Dataset,
        frame: usize,
        place: Option<usize>,
    ) -> Result<Option<Grid>> {
        Ok(match self {
            Self::Scans(kind) => {
                let depth = dataset.ground_truth(frame, *kind)?;
                depth.map(|depth| Grid::from(&depth))
            }
            Self::Arrays(arrays) => place.map(|place| arrays.read(place)).transpose()?,
        })
    }
}

/// Whether recordings have ground truth of a kind, of any of their selected frames.
#[must_use]
pub fn has_truth(datasets: &[Dataset], kind: GtKind) -> bool {
    datasets.iter().any(|dataset| {
        let mut frames = dataset.selected().iter();
        frames.any(|frame| dataset.has_ground_truth(*frame, kind))
    })
}

/// The mean-depth baseline's scans: all of the given (training) recordings'.
///
/// # Errors
/// A scan that cannot be read.
pub fn baseline_from_datasets(datasets: &[Dataset], kind: GtKind) -> Result<MeanDepthBaseline> {
    let mut baseline = MeanDepthBaseline::new();
    for dataset in datasets {
        for &frame in dataset.selected() {
            if let Some(depth) = dataset.ground_truth(frame, kind)? {
                baseline.add_scan(&Grid::from(&depth));
            }
        }
    }
    Ok(baseline)
}

/// The mean-depth baseline's scans, from an array file.
///
/// # Errors
/// A file that holds no arrays.
pub fn baseline_from_arrays(path: &Path) -> Result<MeanDepthBaseline> {
    let mut scans = ArraySet::open(path)?;
    let mut baseline = MeanDepthBaseline::new();
    for index in 0..scans.len() {
        baseline.add_scan(&scans.read(index)?);
    }
    Ok(baseline)
}

/// The mean-depth baseline from the recordings a model was trained on, where they are still there.
#[must_use]
pub fn baseline_from_training(config: &TrainConfig, kind: GtKind) -> Option<MeanDepthBaseline> {
    let recordings = training_recordings(config).ok()?;
    let datasets: Vec<_> = recordings.into_iter().map(|(_, dataset)| dataset).collect();
    baseline_from_datasets(&datasets, kind).ok()
}

/// Ground truth as the recordings take it.
#[must_use]
pub fn depth_map(truth: &Grid) -> DepthMap {
    DepthMap {
        width: truth.width(),
        height: truth.height(),
        data: truth.values().iter().map(|d| *d as f32).collect(),
    }
}

/// Frame names to places in the file: by name, or, for a stack without names, in the frames' order.
///
/// # Errors
/// [`Error::StackLength`] for a stack of more or fewer arrays than frames: which is whose would be a guess.
pub fn array_places(arrays: &ArraySet, frames: &[Vec<String>]) -> Result<HashMap<String, usize>> {
    if let Some(names) = arrays.names() {
        return Ok(names.iter().cloned().zip(0..).collect());
    }
    let (found, expected) = (arrays.len(), frames.iter().map(Vec::len).sum());
    if found != expected {
        return Err(Error::StackLength { found, expected });
    }
    Ok(frames.iter().flatten().cloned().zip(0..).collect())
}

/// The network's pixels, by their place in [`Prediction::disparity`], with the true depth in metres: evenly among those of the
/// truth that are within the range, some thousands. The truth is of the whole image, and so is the prediction.
#[must_use]
pub fn known_pixels(truth: &Grid, seen: &Prediction, range_m: &Range<f64>) -> Vec<(usize, f64)> {
    let known: Vec<(usize, f64)> = truth
        .values()
        .iter()
        .enumerate()
        .filter(|(_, z)| range_m.contains(*z))
        .map(|(i, z)| (i, *z))
        .collect();
    let step = known.len().div_ceil(PIXELS).max(1);
    let (width, height) = (truth.width(), truth.height());
    let place = |(i, z): (usize, f64)| {
        // The network's pixel at the truth's.
        let u = (2 * (i % width) + 1) * seen.width / (2 * width);
        let v = (2 * (i / width) + 1) * seen.height / (2 * height);
        (v * seen.width + u, z)
    };
    known.into_iter().step_by(step).map(place).collect()
}
