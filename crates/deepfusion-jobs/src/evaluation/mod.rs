//! Evaluates predictions on recordings with ground truth, or from files of arrays.

mod chosen_images;
mod comparison;
pub mod confidence;
mod coverage;
mod division;
mod measurement;
mod model_sheet;
mod outcome;
mod page;
mod saved;
mod shown_images;
mod truth;
mod used_checkpoint;

use std::collections::HashMap;
use std::path::Path;

use deepfusion_data::{Dataset, DatasetKind, GtKind, RgbImage, ground_truth_names};
use deepfusion_eval::{
    ArraySet, Crop, DrawnPoint, Grid, GroundTruth, ImageScore, MeanDepthBaseline, PostProcess,
    Prediction, Protocol, Report, Sample, match_names, points_csv,
};
use deepfusion_geometry::Intrinsics;
use deepfusion_runtime::{Augmentation, DepthEstimator};

use crate::{Error, Result, files};

pub use self::chosen_images::{ChosenImage, Standing, chosen_images};
pub use self::comparison::Comparison;
pub use self::coverage::{MissingReason, Shortfall, check_used, expected_frames, missing_frames};
pub use self::measurement::{Measurement, MeasurementRequest};
pub use self::model_sheet::{ModelSheet, comparison_page};
pub use self::outcome::EvaluationOutcome;
pub use self::page::{EvaluationPage, MeasuredDepth};
pub use self::saved::EvaluationRequest;
pub use self::shown_images::{shown_of_arrays, shown_of_datasets};
pub use self::truth::{
    Truth, array_places, baseline_from_arrays, baseline_from_datasets, baseline_from_training,
    depth_map, has_truth, known_pixels,
};
pub use self::used_checkpoint::UsedCheckpoint;

/// The usual crop for the recordings: Garg's if all are KITTI raw, as in its published results; otherwise the whole image.
#[must_use]
pub fn default_crop(datasets: &[Dataset]) -> Crop {
    let kitti = |d: &Dataset| d.kind() == DatasetKind::KittiRaw;
    if datasets.iter().all(kitti) {
        Crop::Garg
    } else {
        Crop::None
    }
}

/// The place of an evaluated image: the index of its data set and frame, or of its prediction and ground truth in array files.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct ImageRef(pub usize, pub usize);

/// The results of an evaluation.
pub struct Evaluated {
    /// The metrics.
    pub report: Report,
    /// Each image's scores.
    pub images: Vec<ImageScore>,
    /// The points that were sampled for drawing.
    pub points: Vec<DrawnPoint>,
    /// The place of each image.
    pub places: Vec<ImageRef>,
}

impl Evaluated {
    /// Writes the sampled points as a table, one per line.
    ///
    /// # Errors
    /// A file that cannot be written.
    pub fn write_points(&self, path: &Path) -> Result<()> {
        let in_space = self.report.points.as_ref().is_some_and(|p| p.in_space);
        let text = points_csv(&self.points, &self.images, in_space)?;
        Ok(files::write(path, text)?)
    }
}

/// The test-time augmentation for a kind of post-processing.
#[must_use]
pub fn augmentation(how: Option<PostProcess>) -> Augmentation {
    match how {
        None => Augmentation::NONE,
        Some(PostProcess::Flip) => Augmentation::FLIP,
        Some(PostProcess::MultiScale) => Augmentation::MULTI_SCALE,
        Some(PostProcess::MultiScaleFlip) => Augmentation::MULTI_SCALE_FLIP,
    }
}

/// The disparity of an image by a single prediction, as the protocol needs it. An image of another aspect ratio is stretched, so that all
/// of its ground truth counts.
///
/// # Errors
/// The error of the network's engine.
pub fn predict(
    estimator: &mut DepthEstimator,
    image: &RgbImage,
    camera: &Intrinsics,
    focal_correction: bool,
) -> Result<Prediction> {
    predict_by(estimator, image, camera, focal_correction, None)
}

/// As [`predict`], with test-time augmentation.
///
/// # Errors
/// The error of the network's engine; several input sizes for a network that takes one.
pub fn predict_by(
    estimator: &mut DepthEstimator,
    image: &RgbImage,
    camera: &Intrinsics,
    focal_correction: bool,
    how: Option<PostProcess>,
) -> Result<Prediction> {
    let preparer = estimator.augmented(augmentation(how))?;
    let prepared = preparer.prepare(image, Some(camera), focal_correction, false);
    let prediction = estimator.infer(&prepared)?;
    let grid = Grid::from_f32(prediction.width, prediction.height, &prediction.disparity)?;
    Ok(Prediction::Disparity(grid))
}

/// An image of a recording, and its disparity by [`predict_by`].
///
/// # Errors
/// An image that cannot be read; an error of [`predict_by`].
pub fn predict_frame(
    estimator: &mut DepthEstimator,
    dataset: &Dataset,
    frame: usize,
    focal_correction: bool,
    how: Option<PostProcess>,
) -> Result<(RgbImage, Prediction)> {
    let image = dataset.load_image(frame)?;
    let camera = dataset.intrinsics(frame);
    let prediction = predict_by(estimator, &image, &camera, focal_correction, how)?;
    Ok((image, prediction))
}

/// Evaluates `predict`, which returns the prediction for an image given by data set and frame, on every selected frame that has ground
/// truth; `progress` receives the number of frames done, and of all.
///
/// # Errors
/// An error of `predict`; an image that cannot be read or compared.
pub fn evaluate_datasets<E: From<Error>>(
    datasets: &[Dataset],
    truth: &mut Truth,
    protocol: &Protocol,
    baseline: Option<MeanDepthBaseline>,
    predict: &mut dyn FnMut(&Dataset, usize) -> Result<Prediction, E>,
    progress: &mut dyn FnMut(usize, usize),
) -> Result<Evaluated, E> {
    let mut comparison = Comparison::new(protocol, baseline)?;
    let names = ground_truth_names(datasets);
    let total = names.iter().map(Vec::len).sum();
    let arrays = match truth {
        Truth::Scans(_) => HashMap::new(),
        Truth::Arrays(arrays) => array_places(arrays, datasets)?,
    };
    let (mut done, mut places) = (0, Vec::new());
    for (number, (dataset, names)) in datasets.iter().zip(&names).enumerate() {
        let labels = dataset.moving_labels().map_err(Error::from)?;
        for (&frame, name) in dataset.selected().iter().zip(names) {
            let known = truth.of(dataset, frame, arrays.get(name).copied())?;
            if let Some(ground_truth) = known {
                let prediction = predict(dataset, frame)?;
                let dense = dataset.dense_depth(frame).map_err(Error::from)?;
                let dense = dense.map(|depth| Grid::from(&depth));
                let k = dataset.intrinsics(frame);
                let same_size = (k.width as usize, k.height as usize)
                    == (ground_truth.width(), ground_truth.height());
                let moving = match &labels {
                    Some(labels) if same_size => {
                        let of = dataset.frames()[frame].number;
                        let depth = depth_map(&ground_truth);
                        let pixels = labels.pixels(of, &depth, gt_kind(protocol));
                        pixels.map_err(Error::from)?
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
                    places.push(ImageRef(number, frame));
                }
                if let Some(scenario) = dataset.scenario() {
                    comparison.add_to_scenario(scenario, &sample)?;
                }
            }
            done += 1;
            progress(done, total);
        }
    }
    Ok(comparison.evaluated(places)?)
}

/// The recordings' kind of ground truth that the protocol asks for.
fn gt_kind(protocol: &Protocol) -> GtKind {
    match protocol.gt {
        GroundTruth::Z => GtKind::Z,
        GroundTruth::Velodyne => GtKind::Velodyne,
        GroundTruth::Annotated => GtKind::Annotated,
    }
}

/// Compares the arrays of one file with those of another; `of_kind` is the kind of the first file's arrays.
///
/// # Errors
/// Files without arrays; arrays without counterpart; arrays that cannot be compared.
pub fn evaluate_arrays(
    (predicted, of_kind): (&mut ArraySet, &dyn Fn(Grid) -> Prediction),
    known: &mut ArraySet,
    protocol: &Protocol,
    baseline: Option<MeanDepthBaseline>,
    progress: &mut dyn FnMut(usize, usize),
) -> Result<Evaluated> {
    let mut comparison = Comparison::new(protocol, baseline)?;
    let matched = match_names(predicted, known)?;
    let mut places = Vec::new();
    for (i, (name, prediction, depth)) in matched.iter().enumerate() {
        let counted = comparison.add(&Sample {
            name,
            prediction: &of_kind(predicted.read(*prediction)?),
            ground_truth: &known.read(*depth)?,
            moving: None,
            intrinsics: None,
            dense: None,
        })?;
        if counted {
            places.push(ImageRef(*prediction, *depth));
        }
        progress(i + 1, matched.len());
    }
    comparison.evaluated(places)
}
