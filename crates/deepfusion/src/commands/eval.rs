use std::path::Path;

use anyhow::Result;
use deepfusion_data::{Dataset, DatasetKind, GtKind, RgbImage};
use deepfusion_eval::{
    ArraySet, Crop, Grid, Prediction, Report, Sample, TrivialBaseline, match_names,
};
use deepfusion_geometry::Intrinsics;
use deepfusion_train::Predictor;

use super::evaluate::{
    Comparison, Truth, evaluate_datasets, open_with_camera, trivial_from_arrays,
    trivial_from_datasets,
};
use crate::cli::{EvalArgs, PredKind};
use crate::engine;
use crate::output;
use crate::progress::Progress;

/// `deepfusion eval`.
pub fn run(args: &EvalArgs) -> Result<()> {
    let report = match (&args.pred, args.pred_kind, &args.gt) {
        (Some(predictions), Some(kind), Some(truth)) => {
            from_arrays(args, predictions, kind, truth)?
        }
        _ => from_model(args)?,
    };
    if args.json {
        output::print_json(&report)
    } else {
        output::print(&report.to_string())
    }
}

/// Predicts every frame that has ground truth. An image of another aspect ratio is stretched, so that
/// all of its ground truth counts.
fn from_model(args: &EvalArgs) -> Result<Report> {
    let model = args.model.as_deref().unwrap_or(Path::new("."));
    let predictor = engine::load(model, &args.engine)?;
    let split = args.split.as_deref();
    let datasets = open_with_camera(&args.data, split, args.camera, args.intrinsics)?;
    let kitti = |d: &Dataset| d.kind() == DatasetKind::KittiRaw;
    let crop = match datasets.iter().all(kitti) {
        true => Crop::Garg,
        false => Crop::None,
    };
    let kind = args.gt_depth.kind();
    let truth = match &args.gt {
        Some(path) => Truth::Arrays(Box::new(ArraySet::open(path)?)),
        None => Truth::Scans(kind),
    };
    let baseline = match &args.trivial {
        Some(path) => Some(trivial_from_arrays(path)?),
        None => training_scans(&predictor, kind),
    };
    let mut progress = Progress::new("evaluating");
    evaluate_datasets(
        &datasets,
        truth,
        &args.protocol(crop),
        baseline,
        &mut |dataset, frame| {
            let image = dataset.load_image(frame)?;
            predict(
                &predictor,
                &image,
                &dataset.intrinsics(frame),
                !args.no_focal_correction,
            )
        },
        &mut |done, total| progress.set(done, total),
    )
}

/// The disparity of an image, as the protocol wants it.
pub fn predict(
    predictor: &Predictor,
    image: &RgbImage,
    camera: &Intrinsics,
    focal_correction: bool,
) -> Result<Prediction> {
    let prediction = predictor.predict(image, Some(camera), focal_correction, false)?;
    let grid = Grid::from_f32(prediction.width, prediction.height, &prediction.disparity)?;
    Ok(Prediction::Disparity(grid))
}

/// The trivial row from the recordings the model was trained on, where they are still there.
fn training_scans(predictor: &Predictor, kind: GtKind) -> Option<TrivialBaseline> {
    let config = predictor.config();
    let recordings = super::train::training_recordings(config).ok()?;
    let datasets: Vec<_> = recordings.into_iter().map(|(_, dataset)| dataset).collect();
    trivial_from_datasets(&datasets, kind).ok()
}

fn from_arrays(
    args: &EvalArgs,
    predictions: &Path,
    kind: PredKind,
    truth: &Path,
) -> Result<Report> {
    let mut predictions = ArraySet::open(predictions)?;
    let mut truth = ArraySet::open(truth)?;
    let baseline = args
        .trivial
        .as_deref()
        .map(trivial_from_arrays)
        .transpose()?;
    let mut comparison = Comparison::new(&args.protocol(Crop::None), baseline)?;
    let matched = match_names(&predictions, &truth)?;
    let mut progress = Progress::new("evaluating");
    for (i, (name, predicted, known)) in matched.iter().enumerate() {
        let grid = predictions.read(*predicted)?;
        let prediction = match kind {
            PredKind::Depth => Prediction::Depth(grid),
            PredKind::Disparity => Prediction::Disparity(grid),
        };
        comparison.add(&Sample {
            name,
            prediction: &prediction,
            ground_truth: &truth.read(*known)?,
            moving: None,
            intrinsics: None,
        })?;
        progress.set(i + 1, matched.len());
    }
    comparison.report()
}
