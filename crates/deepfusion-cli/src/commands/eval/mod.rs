mod page;
mod verdict;

use deepfusion_hint::count_of;
use std::fmt;
use std::path::Path;

use deepfusion_data::{Dataset, GtKind, OpenOptions};
use deepfusion_eval::verdict::{ScaleCertificate, Verdict};
use deepfusion_eval::{ArraySet, Crop, Prediction, Report};
use deepfusion_jobs::evaluation::confidence::{self, Calibrated};
use deepfusion_jobs::evaluation::{
    Evaluated, EvaluationRequest, Truth, baseline_from_arrays, baseline_from_training, check_used,
    default_crop, evaluate_arrays, evaluate_datasets, expected_frames, has_truth, predict_frame,
    shown_of_arrays, shown_of_datasets,
};
use deepfusion_jobs::intervals;
use deepfusion_jobs::recordings::read_split;
use deepfusion_perception::Reliability;
use deepfusion_runtime::DepthEstimator;
use deepfusion_runtime::ModelSource;
use serde::Serialize;

use super::clocks;
use super::recordings::{open_recordings, open_with_yaw};
use super::run_report;
use super::used_checkpoint::UsedCheckpoint;
use super::warnings;
use crate::cli::{CameraIntrinsics, EvalArgs, PredKind};
use crate::engine;
use crate::error::CliError;
use crate::failure::Result;
use crate::model::{self, ModelFacts};
use crate::output;
use crate::progress::{Progress, say};

/// `deepfusion eval`.
pub(super) fn run(args: &EvalArgs) -> Result<()> {
    for file in [&args.report, &args.points_out].into_iter().flatten() {
        output::require_folder_of(file)?;
    }
    let found = match (&args.pred, args.pred_kind, &args.gt) {
        (Some(predictions), Some(kind), Some(truth)) => Found {
            report: Some(from_arrays(args, predictions, kind, truth)?),
            ..Found::default()
        },
        _ => from_model(args)?,
    };
    if args.json {
        return output::print_json(&found.printed());
    }
    output::print(&found.to_string())
}

/// What was found, as far as the data show it.
#[derive(Default)]
struct Found {
    checkpoint: Option<UsedCheckpoint>,
    /// With ground truth.
    report: Option<Report>,
    /// Without it.
    verdict: Option<Verdict>,
}

impl Found {
    fn printed(&self) -> Printed<'_> {
        let certificate = self
            .verdict
            .as_ref()
            .and_then(|v| v.scale_certificate.as_ref());
        Printed {
            checkpoint: self.checkpoint.as_ref(),
            report: self.report.as_ref(),
            certificate: certificate.filter(|_| self.report.is_none()),
            verdict: self.verdict.as_ref(),
        }
    }
}

impl fmt::Display for Found {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        if let Some(checkpoint) = &self.checkpoint {
            write!(f, "{checkpoint}\n\n")?;
        }
        if let Some(report) = &self.report {
            write!(f, "{report}")?;
        }
        if let Some(verdict) = &self.verdict {
            let between = if self.report.is_some() { "\n" } else { "" };
            write!(f, "{between}{verdict}")?;
        }
        Ok(())
    }
}

/// What `--json` prints.
#[derive(Serialize)]
struct Printed<'a> {
    #[serde(skip_serializing_if = "Option::is_none")]
    checkpoint: Option<&'a UsedCheckpoint>,
    #[serde(flatten)]
    report: Option<&'a Report>,
    /// The certificate where there is nothing else to go by; it is always in `scale_certificate`.
    #[serde(skip_serializing_if = "Option::is_none")]
    certificate: Option<&'a ScaleCertificate>,
    #[serde(flatten)]
    verdict: Option<&'a Verdict>,
}

/// Predicts every frame that has ground truth. An image of another aspect ratio is stretched, so that
/// all of its ground truth counts.
fn from_model(args: &EvalArgs) -> Result<Found> {
    let model = model::chosen(args.model.as_deref())?;
    if args.calibrate_confidence && model.folder().is_none() {
        let (option, model) = ("--calibrate-confidence", model.name());
        return Err(CliError::NoRunFolder { option, model }.into());
    }
    let mut estimator = engine::load(&model, &args.engine)?;
    model::warn_of_one_size(&model, estimator.config(), args.post_process);
    if args.calibrate_uncertainty {
        check_calibration(&model, &estimator)?;
    }
    let mut options = OpenOptions {
        camera: args.camera,
        split: read_split(args.split.as_deref())?,
        intrinsics: args.intrinsics.map(CameraIntrinsics::numbers),
        hfov_deg: args.hfov,
        topics: args.topics.clone(),
        assumed_camera: model.assumed_camera(args.engine.set.as_deref())?,
        ..OpenOptions::default()
    };
    options.camera_ahead_s = clocks::seconds(args.clock_offset, &args.data, &options)?;
    let datasets = if verdict::is_declined(args) {
        open_recordings(&args.data, &options)?
    } else {
        open_with_yaw(&args.data, &options)?
    };
    let found = verdict::of_model(args, &model, &mut estimator, &datasets)?;
    // A figure that needs ground truth is an error where there is none.
    let needs_truth = args.gt_depth == GtKind::Annotated || args.points_out.is_some();
    let knows_truth = || args.gt.is_some() || has_truth(&datasets, args.gt_depth);
    if found.is_some() && !needs_truth && !knows_truth() {
        return verdict::alone(args, &model, found, UsedCheckpoint::of(&estimator, &model));
    }
    let expected = expected_frames(&options, &datasets, args.strict)?;
    let crop = default_crop(&datasets);
    let kind = args.gt_depth;
    let mut truth = match &args.gt {
        Some(path) => Truth::Arrays(Box::new(ArraySet::open(path)?)),
        None => Truth::Scans(kind),
    };
    let baseline = match &args.trivial {
        Some(path) => Some(baseline_from_arrays(path)?),
        None => baseline_from_training(estimator.config(), kind),
    };
    let protocol = args.protocol(crop);
    let mut progress = Progress::new("evaluating");
    let see = |estimator: &mut DepthEstimator, dataset: &Dataset, frame: usize| {
        let (correct, how) = (!args.no_focal_correction, args.post_process);
        predict_frame(estimator, dataset, frame, correct, how)
    };
    let mut evaluated = evaluate_datasets(
        &datasets,
        &mut truth,
        &protocol,
        baseline,
        &mut |dataset, frame| see(&mut estimator, dataset, frame).map(|(_, prediction)| prediction),
        &mut |done, total| progress.set(done, total),
    )?;
    evaluated.report.expected = expected;
    if let Some(shortfall) = check_used(&options, &datasets, evaluated.report.n, args.strict)? {
        warnings::warn_once(shortfall.to_string());
    }
    // The intervals that a network predicts are those of its own prediction alone.
    if estimator.knows_uncertainty() && args.gt.is_none() && args.post_process.is_none() {
        let kept = intervals::measure(
            (&model, &mut estimator),
            &datasets,
            &mut truth,
            &mut evaluated,
            (&protocol, !args.no_focal_correction),
            args.calibrate_uncertainty,
        )?;
        if let Some((found, path)) = kept {
            say(&format!(
                "intervals calibrated on {} of {}, kept as {}; the figures below are of the same pixels: measure on other drives",
                count_of(found.pixels, "pixel"),
                count_of(found.drives, "drive"),
                path.display()
            ));
        }
    }
    write_points(args, &evaluated)?;
    let saved = request(args).saved(&model, &estimator, &datasets, &evaluated)?;
    match model.folder().map(|folder| saved.write(folder)) {
        Some(Ok(path)) => say(&format!("kept as {}", path.display())),
        // A run on a disk that cannot be written is measured all the same.
        Some(Err(error)) => tracing::warn!("the result is not kept beside the run: {error}"),
        None => say(&format!(
            "not kept: `{}` has no run's folder; --json prints what `compare` reads",
            model.name()
        )),
    }
    let reliability = match (args.calibrate_confidence, model.folder()) {
        (true, Some(folder)) => confidence::calibrate(
            &mut estimator,
            &datasets,
            &mut truth,
            &evaluated,
            !args.no_focal_correction,
            folder,
        )?
        .map(print_calibrated),
        _ => None,
    };
    if let Some(path) = &args.report {
        let shown = shown_of_datasets(&datasets, &mut truth, &evaluated, |dataset, frame| {
            see(&mut estimator, dataset, frame)
        })?;
        let how = page::how_a_model_was_measured(args, &protocol, &saved);
        let mut page = page::of(args, &model.name(), &evaluated, &shown, &how)?;
        if let Some(bins) = reliability {
            page = run_report::reliability(page, &bins);
        }
        if let Some(found) = &found {
            page = run_report::verdict(page, found);
        }
        if let Some(folder) = model.folder() {
            page = run_report::training(page, folder)?;
        }
        page.write(path)?;
        say(&format!("report  {}", path.display()));
    }
    Ok(Found {
        checkpoint: Some(UsedCheckpoint::of(&estimator, &model)),
        report: Some(evaluated.report),
        verdict: found,
    })
}

/// That a network's intervals can be calibrated at all, before anything is measured.
fn check_calibration(model: &ModelSource, estimator: &DepthEstimator) -> Result<()> {
    if !estimator.knows_uncertainty() {
        return Err(deepfusion_jobs::Error::NoUncertainty.into());
    }
    match model.folder() {
        Some(_) => Ok(()),
        None => Err(CliError::NoRunFolder {
            option: "--calibrate-uncertainty",
            model: model.name(),
        }
        .into()),
    }
}

/// Says what the confidence was learned from; gives how it holds.
fn print_calibrated(calibrated: Calibrated) -> Vec<Reliability> {
    let Calibrated {
        confidence,
        path,
        by_drive,
        reliability,
    } = calibrated;
    let judged_by = match (confidence.held_out, by_drive) {
        (0, _) => "none left to judge it by".to_owned(),
        (n, true) => format!("judged by {n} of other drives"),
        (n, false) => format!("judged by {n} of another part"),
    };
    say(&format!(
        "confidence learned from {}, {judged_by}, kept as {}",
        count_of(confidence.frames, "frame"),
        path.display()
    ));
    reliability
}

fn from_arrays(
    args: &EvalArgs,
    predictions: &Path,
    kind: PredKind,
    truth: &Path,
) -> Result<Report> {
    let mut predicted = ArraySet::open(predictions)?;
    let mut known = ArraySet::open(truth)?;
    let baseline = args
        .trivial
        .as_deref()
        .map(baseline_from_arrays)
        .transpose()?;
    let protocol = args.protocol(Crop::None);
    let mut progress = Progress::new("evaluating");
    let of_kind = |grid| match kind {
        PredKind::Depth => Prediction::Depth(grid),
        PredKind::Disparity => Prediction::Disparity(grid),
    };
    let evaluated = evaluate_arrays(
        (&mut predicted, &of_kind),
        &mut known,
        &protocol,
        baseline,
        &mut |done, total| progress.set(done, total),
    )?;
    write_points(args, &evaluated)?;
    if let Some(path) = &args.report {
        let shown = shown_of_arrays((&mut predicted, &of_kind), &mut known, &evaluated)?;
        let how = [
            ("predictions", predictions.display().to_string()),
            ("ground truth", truth.display().to_string()),
        ];
        let mut how: Vec<_> = how.map(|(a, b)| (a.to_owned(), b)).into();
        how.extend(page::protocol_rows(&protocol));
        let name = output::name_of(predictions);
        page::of(args, &name, &evaluated, &shown, &how)?.write(path)?;
        say(&format!("report  {}", path.display()));
    }
    Ok(evaluated.report)
}

/// How a network is measured, as its evaluation keeps it.
fn request(args: &EvalArgs) -> EvaluationRequest<'_> {
    EvaluationRequest {
        data: &args.data,
        split: args.split.as_deref(),
        truth: args.gt.as_deref(),
        camera: args.camera,
        precision: args.engine.precision,
        set: args.engine.set.as_deref(),
        focal_correction: !args.no_focal_correction,
        post_process: args.post_process,
        program: format!("deepfusion {}", env!("CARGO_PKG_VERSION")),
        command: run_report::command(),
    }
}

/// Writes the drawn points where `--points-out` asks for them.
fn write_points(args: &EvalArgs, evaluated: &Evaluated) -> Result<()> {
    let Some(path) = &args.points_out else {
        return Ok(());
    };
    evaluated.write_points(path)?;
    say(&format!("points  {}", path.display()));
    Ok(())
}
