mod verdict;

use deepfusion_hint::count_of;
use std::fmt;
use std::path::Path;

use deepfusion_data::{Dataset, GtKind, OpenOptions, RgbImage};
use deepfusion_eval::compare::{FrameScore, Measured, ModelFile, SAVED_VERSION, SavedEvaluation};
use deepfusion_eval::verdict::{ScaleCertificate, Verdict};
use deepfusion_eval::{ArraySet, Crop, Grid, Prediction, Protocol, Report, points_csv};
use deepfusion_geometry::Intrinsics;
use deepfusion_jobs::evaluation::confidence::{self, Calibrated};
use deepfusion_jobs::evaluation::{
    Evaluated, ImageRef, Truth, array_places, baseline_from_arrays, baseline_from_training,
    check_used, default_crop, depth_map, evaluate_arrays, evaluate_datasets, expected_frames,
    predict_by,
};
use deepfusion_jobs::held_out::learned_from_none;
use deepfusion_jobs::intervals;
use deepfusion_jobs::recordings::{camera_word, read_split};
use deepfusion_perception::Reliability;
use deepfusion_render::{HtmlReport, ShownFrame};
use deepfusion_runtime::DepthEstimator;
use deepfusion_runtime::ModelSource;
use serde::Serialize;

use super::clocks;
use super::recordings::{open_recordings, open_with_yaw};
use super::run_report::{self, Choice};
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
    if found.is_some() && !needs_truth && !verdict::has_truth(args, &datasets) {
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
    let see = |estimator: &mut DepthEstimator, dataset: &Dataset, frame: usize| -> Result<_> {
        let image = dataset.load_image(frame)?;
        let camera = dataset.intrinsics(frame);
        let (correct, how) = (!args.no_focal_correction, args.post_process);
        let prediction = predict_by(estimator, &image, &camera, correct, how)?;
        Ok((image, prediction))
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
    let saved = saved(args, &estimator, &model, &datasets, &evaluated)?;
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
        let names = deepfusion_data::ground_truth_names(&datasets);
        let arrays = match &truth {
            Truth::Scans(_) => Default::default(),
            Truth::Arrays(arrays) => array_places(arrays, &names),
        };
        let shown = shown(&evaluated, |ImageRef(number, frame)| {
            let dataset = &datasets[number];
            let place = dataset.selected().iter().position(|f| *f == frame);
            let name = place.and_then(|p| names[number].get(p));
            let array = name.and_then(|n| arrays.get(n)).copied();
            let (image, prediction) = see(&mut estimator, dataset, frame)?;
            let depth = truth.of(dataset, frame, array)?;
            Ok(depth.map(|depth| Seen {
                image: Some(image),
                prediction,
                truth: depth,
                camera: Some(dataset.intrinsics(frame)),
            }))
        })?;
        let how = how_a_model_was_measured(args, &protocol, &saved);
        let mut page = page(args, &model.name(), &evaluated, &shown, &how)?;
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
        let shown = shown(&evaluated, |ImageRef(prediction, depth)| {
            Ok(Some(Seen {
                image: None,
                prediction: of_kind(predicted.read(prediction)?),
                truth: known.read(depth)?,
                camera: None,
            }))
        })?;
        let how = [
            ("predictions", predictions.display().to_string()),
            ("ground truth", truth.display().to_string()),
        ];
        let mut how: Vec<_> = how.map(|(a, b)| (a.to_owned(), b)).into();
        how.extend(protocol_rows(&protocol));
        let name = output::name_of(predictions);
        page(args, &name, &evaluated, &shown, &how)?.write(path)?;
        say(&format!("report  {}", path.display()));
    }
    Ok(evaluated.report)
}

/// Writes the drawn points where `--points-out` asks for them.
fn write_points(args: &EvalArgs, evaluated: &Evaluated) -> Result<()> {
    let Some(path) = &args.points_out else {
        return Ok(());
    };
    let in_space = evaluated.report.points.as_ref().is_some_and(|p| p.in_space);
    let text = points_csv(&evaluated.points, &evaluated.images, in_space)?;
    deepfusion_fs::write(path, text).map_err(|e| deepfusion_data::Error::file(path, e))?;
    say(&format!("points  {}", path.display()));
    Ok(())
}

/// What there is to show of an image.
struct Seen {
    image: Option<RgbImage>,
    prediction: Prediction,
    truth: Grid,
    camera: Option<Intrinsics>,
}

/// The frames worth showing, looked at again.
fn shown(
    evaluated: &Evaluated,
    mut see: impl FnMut(ImageRef) -> Result<Option<Seen>>,
) -> Result<Vec<(Choice, ShownFrame)>> {
    let mut frames = Vec::new();
    for choice in run_report::choose(evaluated) {
        if let Some(seen) = see(evaluated.places[choice.image])? {
            let truth = depth_map(&seen.truth);
            let frame = ShownFrame {
                title: choice.title.clone(),
                image: seen.image,
                prediction: seen.prediction.depth_at(truth.width, truth.height),
                truth,
                camera: seen.camera,
            };
            frames.push((choice, frame));
        }
    }
    Ok(frames)
}

/// The page but for the training of the model.
fn page(
    args: &EvalArgs,
    name: &str,
    evaluated: &Evaluated,
    shown: &[(Choice, ShownFrame)],
    how: &[(String, String)],
) -> Result<HtmlReport> {
    let report = &evaluated.report;
    let number = |v: f64| format!("{v:.3}");
    let mean_depth_baseline = report
        .mean_depth_baseline
        .as_ref()
        .map(|t| t.unscaled.abs_rel);
    let names: Vec<_> = args.data.iter().map(|p| output::name_of(p)).collect();
    let on = if names.is_empty() {
        String::new()
    } else {
        format!(" on {}", names.join(", "))
    };
    let images = match report.expected {
        Some(expected) => format!("{} of the split's {expected}", report.n),
        None => report.n.to_string(),
    };
    let page = HtmlReport::new(name, format!("Depth measured{on}"))
        .facts(&[
            ("Abs Rel, unscaled", &number(report.unscaled.abs_rel)),
            (
                "Abs Rel, mean-depth baseline",
                &mean_depth_baseline.map_or("–".into(), number),
            ),
            ("scale (1 is metric)", &number(report.scale.median)),
            (
                "within 25 %",
                &format!("{:.1} %", 100.0 * report.unscaled.a1),
            ),
            ("images", &images),
        ])
        .section("Accuracy");
    let page = run_report::accuracy(page, evaluated);
    let page = run_report::frames(page, shown)?;
    Ok(page
        .section("How it was measured")
        .properties(how)
        .command(&run_report::command()))
}

/// The evaluation as it is kept beside a run.
fn saved(
    args: &EvalArgs,
    estimator: &DepthEstimator,
    model: &ModelSource,
    datasets: &[Dataset],
    evaluated: &Evaluated,
) -> Result<SavedEvaluation> {
    let absolute = |p: &std::path::PathBuf| std::path::absolute(p).unwrap_or_else(|_| p.clone());
    let precision = args.engine.precision.name();
    Ok(SavedEvaluation {
        format_version: SAVED_VERSION,
        measured: Measured {
            data: args.data.iter().map(absolute).collect(),
            split: args.split.as_ref().map(absolute),
            gt: args.gt.as_ref().map(absolute),
            camera: camera_word(args.camera).into(),
            engine: format!("{} {precision}", estimator.engine()),
            set: args.engine.set.clone(),
            focal_correction: !args.no_focal_correction,
            post_process: args.post_process,
            held_out: learned_from_none(model, estimator.config(), datasets, &evaluated.places)?,
            program: format!("deepfusion {}", env!("CARGO_PKG_VERSION")),
            command: run_report::command(),
            time: output::now(),
        },
        model: ModelFile {
            sha256: model.sha256()?,
            checkpoint: match model {
                ModelSource::Run { folder, kind, .. } => {
                    output::name_of(&folder.checkpoint_path(*kind))
                }
                ModelSource::Packed { network, .. } => network.card.name.clone(),
            },
        },
        report: evaluated.report.clone(),
        images: evaluated.images.iter().map(FrameScore::from).collect(),
    })
}

fn how_a_model_was_measured(
    args: &EvalArgs,
    protocol: &Protocol,
    saved: &SavedEvaluation,
) -> Vec<(String, String)> {
    let m = &saved.measured;
    let data = args.data.iter().map(|p| p.display().to_string());
    let truth = match &args.gt {
        Some(path) => path.display().to_string(),
        None if args.gt_depth == GtKind::Annotated => "KITTI's annotated depth".into(),
        None => "the recordings' scans".into(),
    };
    let mut rows = vec![
        ("recordings", data.collect::<Vec<_>>().join(", ")),
        ("ground truth", truth),
        ("camera", m.camera.clone()),
        ("checkpoint", saved.model.checkpoint.clone()),
        ("its SHA-256", saved.model.sha256.clone()),
        ("engine", m.engine.clone()),
        (
            "seen in training",
            match m.held_out {
                Some(true) => "no",
                Some(false) => "yes",
                None => "not known",
            }
            .into(),
        ),
        (
            "correction for the focal length",
            if m.focal_correction { "on" } else { "off" }.into(),
        ),
        ("program", m.program.clone()),
        ("time (UTC)", m.time.clone()),
    ];
    if let Some(how) = m.post_process {
        rows.push(("post-processing", how.explained().to_owned()));
    }
    if let Some(split) = &args.split {
        rows.insert(1, ("split", split.display().to_string()));
    }
    let mut rows: Vec<_> = rows.into_iter().map(|(a, b)| (a.to_owned(), b)).collect();
    rows.extend(protocol_rows(protocol));
    if let Some(digest) = &saved.report.truth_sha256 {
        rows.push(("SHA-256 of the ground truth".to_owned(), digest.clone()));
    }
    rows
}

fn protocol_rows(protocol: &Protocol) -> [(String, String); 2] {
    let crop = match protocol.crop {
        Crop::None => "the whole image",
        Crop::Garg => "Garg's crop",
    };
    [
        ("compared".to_owned(), crop.to_owned()),
        (
            "range".to_owned(),
            format!("{} to {} m", protocol.min_m, protocol.cap_m),
        ),
    ]
}
