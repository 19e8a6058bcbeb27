//! Evaluation shared by `eval`, `demo` and training reports.

use std::collections::{BTreeMap, HashMap};
use std::path::{Path, PathBuf};

use deepfusion_data::{
    Cameras, Dataset, DatasetKind, GtKind, OpenOptions, Split, SplitCoverage, ground_truth_names,
};
use deepfusion_eval::{
    ArraySet, Crop, DrawnPoint, Evaluator, Grid, GroundTruth, ImageScore, Prediction, Protocol,
    Report, Sample, ScenarioRow, TrivialBaseline,
};
use deepfusion_geometry::DepthMap;

use super::remarks;
use crate::error::CliError;
use crate::failure::Result;

/// Opens the recordings at several paths, each drive and camera a data set, and tells what was noticed.
pub fn open_datasets(
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

/// As [`open_datasets`], as the options say; a split of which frames are missing is told, too.
pub fn open_recordings(paths: &[PathBuf], options: &OpenOptions) -> Result<Vec<Dataset>> {
    let datasets = open_quietly(paths, options)?;
    remarks::tell(&datasets);
    tell_of_missing_frames(options, &datasets);
    Ok(datasets)
}

/// As [`open_recordings`], without telling anything.
pub fn open_quietly(paths: &[PathBuf], options: &OpenOptions) -> Result<Vec<Dataset>> {
    let mut datasets = Vec::new();
    for path in paths {
        datasets.extend(Dataset::open(path, options)?);
    }
    Ok(datasets)
}

/// The crop of the recordings' field: Garg's where all of them are KITTI raw, which its tables use; else the whole image.
pub fn default_crop(datasets: &[Dataset]) -> Crop {
    let kitti = |d: &Dataset| d.kind() == DatasetKind::KittiRaw;
    if datasets.iter().all(kitti) {
        Crop::Garg
    } else {
        Crop::None
    }
}

/// The split file of a name, read.
pub fn read_split(path: Option<&Path>) -> Result<Option<Split>> {
    Ok(path.map(Split::read).transpose()?)
}

/// Warns where a split names frames that are not there.
pub fn tell_of_missing_frames(options: &OpenOptions, datasets: &[Dataset]) {
    let Some(split) = &options.split else { return };
    let coverage = split.coverage(datasets);
    if let Some(first) = &coverage.first_missing {
        let SplitCoverage {
            expected, found, ..
        } = coverage;
        remarks::warn_once(format!(
            "{}: {found} of its {expected} frames are there ({:.1} %), the first that is not: {first}",
            split.path.display(),
            percent(found, expected)
        ));
    }
}

/// How many frames a split asked for, where there was one; an error where not all are there and they must be.
pub fn expected_frames(
    options: &OpenOptions,
    datasets: &[Dataset],
    strict: bool,
) -> Result<Option<usize>> {
    let Some(split) = &options.split else {
        return Ok(None);
    };
    let coverage = split.coverage(datasets);
    if strict && !coverage.is_complete() {
        Err(CliError::Incomplete {
            split: split.path.clone(),
            found: coverage.found,
            expected: coverage.expected,
            what: "are in the recordings given",
        }
        .into())
    } else {
        Ok(Some(coverage.expected))
    }
}

/// Warns where fewer frames were used than the split asked for and the recordings hold: some have no ground truth. An
/// error where all must be.
pub fn check_used(
    options: &OpenOptions,
    datasets: &[Dataset],
    used: usize,
    strict: bool,
) -> Result<()> {
    let Some(split) = &options.split else {
        return Ok(());
    };
    let SplitCoverage {
        expected, found, ..
    } = split.coverage(datasets);
    if used >= found {
        return Ok(());
    }
    if strict {
        return Err(CliError::Incomplete {
            split: split.path.clone(),
            found: used,
            expected,
            what: "have ground truth",
        }
        .into());
    }
    remarks::warn_once(format!(
        "{}: {used} of its {expected} frames have ground truth ({:.1} %), {} more are there without",
        split.path.display(),
        percent(used, expected),
        found - used
    ));
    Ok(())
}

fn percent(part: usize, whole: usize) -> f64 {
    100.0 * part as f64 / whole.max(1) as f64
}

/// Where the truth comes from.
pub enum Truth {
    /// The recordings' scans.
    Scans(GtKind),
    /// A file of arrays that are named as `data export-gt` names them.
    Arrays(Box<ArraySet>),
}

impl Truth {
    /// Of a frame; `place` is where an array file has it.
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

/// The trivial row's scans: all of the given (training) recordings'.
pub fn trivial_from_datasets(datasets: &[Dataset], kind: GtKind) -> Result<TrivialBaseline> {
    let mut baseline = TrivialBaseline::new();
    for dataset in datasets {
        for &frame in dataset.selected() {
            if let Some(depth) = dataset.ground_truth(frame, kind)? {
                baseline.add_scan(&Grid::from(&depth));
            }
        }
    }
    Ok(baseline)
}

/// The trivial row's scans, from an array file.
pub fn trivial_from_arrays(path: &Path) -> Result<TrivialBaseline> {
    let mut scans = ArraySet::open(path)?;
    let mut baseline = TrivialBaseline::new();
    for index in 0..scans.len() {
        baseline.add_scan(&scans.read(index)?);
    }
    Ok(baseline)
}

/// Where an evaluated image is: the data set and its frame, or the place of its prediction and truth in array files.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Place(pub usize, pub usize);

/// What an evaluation found.
pub struct Evaluated {
    /// The result.
    pub report: Report,
    /// Each image's scores.
    pub images: Vec<ImageScore>,
    /// The points that were drawn.
    pub points: Vec<DrawnPoint>,
    /// Where each image is.
    pub places: Vec<Place>,
}

/// Evaluates a method and, beside it, the trivial baseline on the same images.
pub struct Comparison {
    method: Evaluator,
    trivial: Option<(Evaluator, TrivialBaseline)>,
    /// By kind of drive, where the recordings say theirs.
    scenarios: BTreeMap<String, Evaluator>,
    protocol: Protocol,
}

impl Comparison {
    /// Without any image yet; a baseline without scans gives no trivial row.
    pub fn new(protocol: &Protocol, baseline: Option<TrivialBaseline>) -> Result<Self> {
        let baseline = baseline.filter(|b| b.scans() > 0);
        Ok(Self {
            method: Evaluator::new(protocol.clone())?,
            trivial: match baseline {
                Some(baseline) => Some((Evaluator::new(protocol.clone())?, baseline)),
                None => None,
            },
            scenarios: BTreeMap::new(),
            protocol: protocol.clone(),
        })
    }

    /// Compares one image; whether it had a pixel to compare.
    pub fn add(&mut self, image: &Sample<'_>) -> Result<bool> {
        let counted = self.method.add_sample(image)?.is_some();
        if let Some((evaluator, baseline)) = &mut self.trivial {
            // A baseline of this one scan alone has nothing else to say than "80 m": that is its score.
            let depth = baseline.depth_for(Some(image.ground_truth))?;
            evaluator.add(image.name, &Prediction::Depth(depth), image.ground_truth)?;
        }
        Ok(counted)
    }

    /// Counts an image for its kind of drive, too.
    pub fn add_to_scenario(&mut self, name: &str, image: &Sample<'_>) -> Result<()> {
        if !self.scenarios.contains_key(name) {
            let evaluator = Evaluator::new(self.protocol.clone())?;
            self.scenarios.insert(name.to_owned(), evaluator);
        }
        if let Some(evaluator) = self.scenarios.get_mut(name) {
            evaluator.add_sample(image)?;
        }
        Ok(())
    }

    /// All that was found; `places` says where the images that counted are.
    pub fn evaluated(&self, places: Vec<Place>) -> Result<Evaluated> {
        Ok(Evaluated {
            report: self.report()?,
            images: self.method.images().to_vec(),
            points: self.method.drawn_points().to_vec(),
            places,
        })
    }

    /// The method's report with the trivial row, and a row for each kind of drive where there are several.
    fn report(&self) -> Result<Report> {
        let mut report = self.method.report()?;
        if self.scenarios.len() > 1 {
            for (name, evaluator) in &self.scenarios {
                let row = ScenarioRow::new(name, &evaluator.report()?);
                report.scenarios.push(row);
            }
        }
        Ok(match &self.trivial {
            Some((evaluator, _)) => report.with_trivial(&evaluator.report()?),
            None => report,
        })
    }
}

/// Evaluates `predict` (data set, frame, its image's prediction) on every selected frame that has ground truth.
pub fn evaluate_datasets(
    datasets: &[Dataset],
    truth: &mut Truth,
    protocol: &Protocol,
    baseline: Option<TrivialBaseline>,
    predict: &mut dyn FnMut(&Dataset, usize) -> Result<Prediction>,
    progress: &mut dyn FnMut(usize, usize),
) -> Result<Evaluated> {
    let mut comparison = Comparison::new(protocol, baseline)?;
    let names = ground_truth_names(datasets);
    let total = names.iter().map(Vec::len).sum();
    let arrays = match truth {
        Truth::Scans(_) => HashMap::new(),
        Truth::Arrays(arrays) => array_places(arrays, &names),
    };
    let (mut done, mut places) = (0, Vec::new());
    for (number, (dataset, names)) in datasets.iter().zip(&names).enumerate() {
        let labels = dataset.moving_labels()?;
        for (&frame, name) in dataset.selected().iter().zip(names) {
            let known = truth.of(dataset, frame, arrays.get(name).copied())?;
            if let Some(ground_truth) = known {
                let prediction = predict(dataset, frame)?;
                let dense = dataset.dense_depth(frame)?.map(|depth| Grid::from(&depth));
                let k = dataset.intrinsics(frame);
                let same_size = (k.width as usize, k.height as usize)
                    == (ground_truth.width(), ground_truth.height());
                let moving = match &labels {
                    Some(labels) if same_size => {
                        let of = dataset.frames()[frame].number;
                        labels.pixels(of, &depth_map(&ground_truth), gt_kind(protocol))?
                    }
                    _ => None,
                };
                let sample = Sample {
                    name,
                    prediction: &prediction,
                    ground_truth: &ground_truth,
                    moving: moving.as_deref(),
                    intrinsics: same_size.then_some(&k),
                    dense: dense.as_ref(),
                };
                if comparison.add(&sample)? {
                    places.push(Place(number, frame));
                }
                if let Some(scenario) = dataset.scenario() {
                    comparison.add_to_scenario(scenario, &sample)?;
                }
            }
            done += 1;
            progress(done, total);
        }
    }
    comparison.evaluated(places)
}

/// Which depth the ground truth holds, in the recordings' words.
fn gt_kind(protocol: &Protocol) -> GtKind {
    match protocol.gt {
        GroundTruth::Z => GtKind::Z,
        GroundTruth::Velodyne => GtKind::Velodyne,
    }
}

/// Ground truth as the recordings take it.
pub fn depth_map(truth: &Grid) -> DepthMap {
    DepthMap {
        width: truth.width(),
        height: truth.height(),
        data: truth.values().iter().map(|d| *d as f32).collect(),
    }
}

/// Frame names to places in the file: by name, or, for a stack without names, in the frames' order.
pub fn array_places(arrays: &ArraySet, frames: &[Vec<String>]) -> HashMap<String, usize> {
    match arrays.names() {
        Some(names) => names.iter().cloned().zip(0..).collect(),
        None => frames
            .iter()
            .flatten()
            .cloned()
            .zip(0..arrays.len())
            .collect(),
    }
}
