//! The sources of ground truth, the pixels of a prediction for which it is known, and the mean depth of scans as a baseline.

use std::collections::HashMap;
use std::ops::Range;
use std::path::Path;

use deepfusion_data::{Dataset, GtKind, ground_truth_names};
use deepfusion_eval::{ArraySet, Grid, MeanDepthBaseline};
use deepfusion_geometry::DepthMap;
use deepfusion_model::TrainConfig;
use deepfusion_runtime::Prediction;

use crate::recordings::plain_training_recordings;
use crate::{Error, Result};

/// The most pixels that [`known_pixels`] takes of a frame.
const PIXELS: usize = 4_000;

/// The source of the ground truth.
pub enum Truth {
    /// The recordings' scans.
    Scans(GtKind),
    /// A file of arrays, named as `data export-gt` names them.
    Arrays(Box<ArraySet>),
}

impl Truth {
    /// The ground truth of a frame; `place` is its index in an array file. `None` if the frame has none.
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

/// Whether any selected frame of the recordings has ground truth of a kind.
#[must_use]
pub fn has_truth(datasets: &[Dataset], kind: GtKind) -> bool {
    datasets.iter().any(|dataset| {
        let mut frames = dataset.selected().iter();
        frames.any(|frame| dataset.has_ground_truth(*frame, kind))
    })
}

/// The mean-depth baseline, from all scans of the given (training) recordings.
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

/// The mean-depth baseline, from the scans in an array file.
///
/// # Errors
/// A file without arrays.
pub fn baseline_from_arrays(path: &Path) -> Result<MeanDepthBaseline> {
    let mut scans = ArraySet::open(path)?;
    let mut baseline = MeanDepthBaseline::new();
    for index in 0..scans.len() {
        baseline.add_scan(&scans.read(index)?);
    }
    Ok(baseline)
}

/// The mean-depth baseline, from the recordings that a model was trained on; `None` if they no longer exist.
#[must_use]
pub fn baseline_from_training(config: &TrainConfig, kind: GtKind) -> Option<MeanDepthBaseline> {
    let recordings = plain_training_recordings(config).ok()?;
    let datasets: Vec<_> = recordings.into_iter().map(|(_, dataset)| dataset).collect();
    baseline_from_datasets(&datasets, kind).ok()
}

/// Ground truth as a depth map.
#[must_use]
pub fn depth_map(truth: &Grid) -> DepthMap {
    DepthMap {
        width: truth.width(),
        height: truth.height(),
        data: truth.values().iter().map(|d| *d as f32).collect(),
    }
}

/// The index in the file for each frame's name: by name or, for a stack without names, in the order of the split file; without a split, in
/// the order of the recordings and their frames.
///
/// # Errors
/// [`Error::StackLength`] if a stack does not have one array for each frame: the assignment would be a guess.
pub fn array_places(arrays: &ArraySet, datasets: &[Dataset]) -> Result<HashMap<String, usize>> {
    if let Some(names) = arrays.names() {
        return Ok(names.iter().cloned().zip(0..).collect());
    }
    let names = ground_truth_names(datasets).into_iter().flatten();
    let places = datasets.iter().flat_map(Dataset::split_places);
    let mut frames: Vec<(&Option<usize>, String)> = places.zip(names).collect();
    let (found, expected) = (arrays.len(), frames.len());
    if found != expected {
        return Err(Error::StackLength { found, expected });
    }
    frames.sort_by_key(|(place, _)| (place.is_none(), **place));
    Ok(frames.into_iter().map(|(_, name)| name).zip(0..).collect())
}

/// Pixels of the network's output, by their index in [`Prediction::disparity`], with their true depth in metres: up to 4,000, evenly
/// chosen among the pixels of the ground truth within the range. Both the ground truth and the prediction cover the whole image.
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
        // The network's pixel at the position of the pixel of the ground truth.
        let u = (2 * (i % width) + 1) * seen.width / (2 * width);
        let v = (2 * (i / width) + 1) * seen.height / (2 * height);
        (v * seen.width + u, z)
    };
    known.into_iter().step_by(step).map(place).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use deepfusion_data::{OpenOptions, Split};
    use deepfusion_sim::{SimConfig, Simulation, write_kitti};
    use std::ops::ControlFlow;

    /// The usual split files are not in the order of the frames, and arrays without names are in the order of the split file.
    #[test]
    fn a_stack_is_in_the_order_of_the_split() {
        let at = tempfile::tempdir().unwrap();
        let simulation = Simulation::new(&SimConfig {
            frames: 5,
            width: 64,
            height: 48,
            scan_every: 0,
            ..SimConfig::default()
        });
        let kitti = at.path().join("kitti");
        let go = &mut |_, _| ControlFlow::Continue(());
        let root = write_kitti(&simulation.unwrap(), &kitti, go).unwrap();
        let drive = Dataset::open(&root, &OpenOptions::default())
            .unwrap()
            .remove(0);
        let lines = [3, 0, 4].map(|frame| format!("{} {frame} l\n", drive.split_name()));
        let split = at.path().join("split.txt");
        std::fs::write(&split, lines.concat()).unwrap();
        let options = OpenOptions {
            split: Some(Split::read(&split).unwrap()),
            ..OpenOptions::default()
        };
        let datasets = Dataset::open(&root, &options).unwrap();
        assert_eq!(datasets[0].split_places(), [Some(1), Some(0), Some(2)]);
        let stack = |arrays: usize| {
            let path = at.path().join("gt.npy");
            ndarray_npy::write_npy(&path, &ndarray::Array3::<f32>::ones((arrays, 48, 64))).unwrap();
            ArraySet::open(&path).unwrap()
        };
        let places = array_places(&stack(3), &datasets).unwrap();
        let place = |frame: u64| places.get(&format!("{frame:010}")).copied();
        assert_eq!([3, 0, 4].map(place), [Some(0), Some(1), Some(2)]);
        let error = array_places(&stack(4), &datasets).unwrap_err();
        assert!(matches!(
            error,
            Error::StackLength {
                found: 4,
                expected: 3
            }
        ));
        // Without a split, in the order of the frames.
        let all = array_places(&stack(5), &[drive]).unwrap();
        assert!((0..5_usize).all(|frame| all.get(&format!("{frame:010}")) == Some(&frame)));
    }
}
