//! A network evaluated on recordings.

use deepfusion_data::{Dataset, GtKind, OpenOptions};
use deepfusion_eval::compare::SavedEvaluation;
use deepfusion_eval::verdict::Verdict;
use deepfusion_hint::count_of;
use deepfusion_jobs::evaluation::confidence;
use deepfusion_jobs::evaluation::{
    Evaluated, EvaluationOutcome, EvaluationPage, EvaluationRequest, MeasuredDepth, Measurement,
    MeasurementRequest, UsedCheckpoint, default_crop, has_truth,
};
use deepfusion_jobs::recordings::read_split;
use deepfusion_perception::Reliability;
use deepfusion_runtime::{DepthEstimator, ModelSource};

use super::{verdict, write_points};
use crate::cli::{CameraIntrinsics, EvalArgs};
use crate::commands::recordings::{open_recordings, open_with_yaw};
use crate::commands::{clocks, command_line, warnings};
use crate::engine;
use crate::error::CliError;
use crate::failure::Result;
use crate::model::{self, ModelFacts};
use crate::progress::{Progress, say};

/// A network, and the recordings that it is evaluated on.
struct EvalInputs {
    model: ModelSource,
    estimator: DepthEstimator,
    options: OpenOptions,
    datasets: Vec<Dataset>,
}

/// Predicts every frame that has ground truth. An image of another aspect ratio is stretched, so that
/// all of its ground truth counts.
pub(super) fn outcome(args: &EvalArgs) -> Result<EvaluationOutcome> {
    let mut inputs = open(args)?;
    let verdict = verdict::of_model(args, &inputs.model, &mut inputs.estimator, &inputs.datasets)?;
    if verdict.is_some() && !with_truth(args, &inputs.datasets) {
        let checkpoint = UsedCheckpoint::of(&inputs.estimator, &inputs.model);
        return verdict::alone(args, &inputs.model, verdict, checkpoint);
    }
    let mut measured = measure(args, &mut inputs)?;
    measure_intervals(args, &mut inputs, &mut measured)?;
    write_points(args, &measured.evaluated)?;
    let request = request(args, &inputs.options, &measured);
    let saved = keep(&request, &inputs, &measured.evaluated)?;
    let reliability = calibrate_confidence(args, &mut inputs, &mut measured)?;
    let without_truth = (reliability.as_deref(), verdict.as_ref());
    let as_kept = (&request, &saved);
    write_page(args, &mut inputs, &mut measured, as_kept, without_truth)?;
    Ok(EvaluationOutcome {
        checkpoint: Some(UsedCheckpoint::of(&inputs.estimator, &inputs.model)),
        report: Some(measured.evaluated.report),
        verdict,
    })
}

/// Opens the network and the recordings. A calibration that could not be saved is refused before anything is measured.
fn open(args: &EvalArgs) -> Result<EvalInputs> {
    warnings::warn_of_hfov(args.hfov);
    let model = model::chosen(args.model.as_deref())?;
    if args.calibrate_confidence && model.folder().is_none() {
        let (option, model) = ("--calibrate-confidence", model.name());
        return Err(CliError::NoRunFolder { option, model }.into());
    }
    let estimator = engine::load(&model, &args.engine)?;
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
    Ok(EvalInputs {
        model,
        estimator,
        options,
        datasets,
    })
}

/// Checks that a network's intervals can be calibrated and saved.
fn check_calibration(model: &ModelSource, estimator: &DepthEstimator) -> Result<()> {
    if !estimator.predicts_uncertainty() {
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

/// Whether to compare depth with ground truth: if there is some, or if an option needs it; then missing ground truth is an error.
fn with_truth(args: &EvalArgs, datasets: &[Dataset]) -> bool {
    let needs_truth = args.gt_depth == GtKind::Annotated
        || args.gt.is_some()
        || args.points_out.is_some()
        || args.calibrate_uncertainty
        || args.calibrate_confidence
        || args.trivial.is_some();
    needs_truth || has_truth(datasets, args.gt_depth)
}

/// Compares depth, and the mean-depth baseline, with ground truth.
fn measure<'a>(args: &'a EvalArgs, inputs: &mut EvalInputs) -> Result<Measurement<'a>> {
    let EvalInputs {
        estimator,
        options,
        datasets,
        ..
    } = inputs;
    let request = MeasurementRequest {
        truth: args.gt.as_deref(),
        baseline: args.trivial.as_deref(),
        protocol: args.protocol(default_crop(datasets)),
        focal_correction: !args.no_focal_correction,
        post_process: args.post_process,
        strict: args.strict,
    };
    let mut progress = Progress::new("evaluating");
    let measured = request.measure(estimator, options, datasets, &mut |done, total| {
        progress.set(done, total);
    })?;
    if let Some(shortfall) = &measured.shortfall {
        warnings::warn_once(shortfall.to_string());
    }
    Ok(measured)
}

/// Adds how often the network's intervals contain the truth, and calibrates them if asked for.
fn measure_intervals(
    args: &EvalArgs,
    inputs: &mut EvalInputs,
    measured: &mut Measurement,
) -> Result<()> {
    let kept = measured.measure_intervals(
        (&inputs.model, &mut inputs.estimator),
        &inputs.datasets,
        args.calibrate_uncertainty,
    )?;
    if let Some((found, path)) = kept {
        say(&format!(
            "intervals calibrated on {} of {} and saved as {}; the results below are for these same pixels: evaluate on other drives as well",
            count_of(found.pixels, "pixel"),
            count_of(found.drives, "drive"),
            path.display()
        ));
    }
    Ok(())
}

/// Saves the evaluation in the run's folder.
fn keep(
    request: &EvaluationRequest<'_>,
    inputs: &EvalInputs,
    evaluated: &Evaluated,
) -> Result<SavedEvaluation> {
    let EvalInputs {
        model,
        estimator,
        datasets,
        ..
    } = inputs;
    let saved = request.saved(model, estimator, datasets, evaluated)?;
    match model.folder().map(|folder| saved.write(folder)) {
        Some(Ok(path)) => say(&format!("saved as {}", path.display())),
        // A run on a read-only disk can still be evaluated.
        Some(Err(error)) => tracing::warn!("the result is not saved in the run's folder: {error}"),
        None => say(&format!(
            "not saved: `{}` has no run folder; --json prints what `compare` reads",
            model.name()
        )),
    }
    Ok(saved)
}

/// How a network was evaluated, as saved with its evaluation.
fn request<'a>(
    args: &'a EvalArgs,
    options: &OpenOptions,
    measured: &Measurement<'a>,
) -> EvaluationRequest<'a> {
    EvaluationRequest {
        data: &args.data,
        split: args.split.as_deref(),
        measurement: measured.request.clone(),
        options: options.clone(),
        precision: args.engine.precision,
        set: args.engine.set.as_deref(),
        program: format!("deepfusion {}", env!("CARGO_PKG_VERSION")),
        command: command_line::typed_again(),
    }
}

/// Fits the confidence of pixels, if asked for, and returns its reliability.
fn calibrate_confidence(
    args: &EvalArgs,
    inputs: &mut EvalInputs,
    measured: &mut Measurement,
) -> Result<Option<Vec<Reliability>>> {
    let (true, Some(folder)) = (args.calibrate_confidence, inputs.model.folder()) else {
        return Ok(None);
    };
    let calibrated = confidence::calibrate(
        &mut inputs.estimator,
        &inputs.datasets,
        &mut measured.truth,
        &measured.evaluated,
        !args.no_focal_correction,
        folder,
    )?;
    Ok(calibrated.map(|calibrated| {
        say(&calibrated.to_string());
        calibrated.reliability
    }))
}

/// Writes the page, with `--report`.
fn write_page(
    args: &EvalArgs,
    inputs: &mut EvalInputs,
    measured: &mut Measurement,
    (request, saved): (&EvaluationRequest<'_>, &SavedEvaluation),
    (reliability, verdict): (Option<&[Reliability]>, Option<&Verdict>),
) -> Result<()> {
    let Some(path) = &args.report else {
        return Ok(());
    };
    let shown = measured.shown(&mut inputs.estimator, &inputs.datasets)?;
    let page = EvaluationPage {
        source: MeasuredDepth::Network {
            model: &inputs.model,
            request,
            saved,
        },
        evaluated: &measured.evaluated,
        shown: &shown,
        reliability,
        verdict,
    };
    page.compose()?.write(path)?;
    say(&format!("report  {}", path.display()));
    Ok(())
}
