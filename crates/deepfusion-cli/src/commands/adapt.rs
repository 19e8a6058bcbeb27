//! `deepfusion adapt`: training on new drives, kept only if the metrics that need no ground truth get no worse.

use std::path::Path;

use deepfusion_jobs::training::Pace;
use deepfusion_jobs::training::adaptation::{
    AdaptSettings, Adaptation, Outcome, Refusal, assumed_camera, require_new, undo,
};
use deepfusion_model::SimulatedCamera;
use deepfusion_runtime::{DepthEstimator, ModelSource};

use super::recordings::{print_warnings, warn_of_sample};
use super::{clocks, train};
use crate::cli::{AdaptArgs, EngineArgs, SimulatedView};
use crate::error::CliError;
use crate::failure::Result;
use crate::model;
use crate::progress::{Progress, say};
use crate::{devices, engine, output};

/// `deepfusion adapt`.
pub(super) fn run(args: &AdaptArgs) -> Result<()> {
    if let Some(out) = &args.undo {
        undo(out)?;
        return output::print(&format!("{}\n", out.display()));
    }
    let out = args.out.as_deref().unwrap_or(Path::new("adapted"));
    require_new(out)?;
    let device = devices::open(args.device)?;
    let given = model::chosen(args.model.as_deref())?;
    let mut before = estimator(args, &given, args.data_set.as_deref())?;
    let settings = settings(args, out, &before)?;
    let mut progress = judging();
    let adaptation = Adaptation::begin(
        given,
        settings,
        &mut before,
        &device,
        &mut print_warnings,
        &mut |done, total| progress.set(done, total),
    )?;
    drop(progress);
    for camera in adaptation.simulated_cameras() {
        say(&own_camera(camera));
    }
    if adaptation.may_have_seen_held_out() {
        say(
            "the given network may have been trained on the frames that are held out here: its metrics may be optimistic",
        );
    }
    let mut trainer = adaptation.trainer(
        &mut print_warnings,
        &mut warn_of_sample,
        &mut train::print_start,
    )?;
    let pace = Pace::of(trainer.config().clone(), args.device.compute());
    let summary = train::train(&mut trainer, Some(pace))?;
    drop(trainer);
    if summary.step < summary.steps {
        return Err(CliError::Stopped {
            step: summary.step,
            steps: summary.steps,
            go_on: "the same command again".into(),
        }
        .into());
    }
    let learned = ModelSource::named(adaptation.work())?;
    let mut learned = estimator(args, &learned, None)?;
    let mut progress = judging();
    let outcome = adaptation.end(summary.steps, &mut learned, &mut |done, total| {
        progress.set(done, total);
    })?;
    drop(progress);
    report(args, outcome)
}

/// A line about a camera for which streets are simulated.
fn own_camera(camera: &SimulatedCamera) -> String {
    let SimulatedCamera { width, height, .. } = camera;
    let above = match camera.height_m {
        Some(metres) => format!(
            "{metres:.2} m above the road, as measured from the road's motion in the images"
        ),
        None => {
            "at any height usual on cars, since the images do not show the road's motion".into()
        }
    };
    format!(
        "streets are simulated for this camera ({width}x{height}, fx {:.0}), {above}",
        camera.fx
    )
}

fn judging() -> Progress {
    Progress::new("evaluating without ground truth")
}

fn estimator(args: &AdaptArgs, model: &ModelSource, set: Option<&str>) -> Result<DepthEstimator> {
    let mut engine = EngineArgs::on(args.device);
    engine.set = set.map(str::to_owned);
    engine::load(model, &engine)
}

/// The settings that the options give.
fn settings(args: &AdaptArgs, out: &Path, given: &DepthEstimator) -> Result<AdaptSettings> {
    let mut settings = AdaptSettings {
        camera: args.camera,
        topics: args.topics.clone(),
        steps: args.steps,
        batch: args.batch,
        simulated: args.simulated,
        own_camera: args.simulated_camera == SimulatedView::Own,
        learning_rate: args.learning_rate,
        held_out: args.held_out,
        speed_sd: args.speed_error / 100.0,
        seed: args.seed,
        set: args.set.clone(),
        compute: args.device.compute(),
        ..AdaptSettings::new(args.data.clone(), out.to_owned())
    };
    let opened = settings.open_options(assumed_camera(given).as_ref());
    settings.camera_ahead_s = clocks::seconds(args.clock_offset, &args.data, &opened)?;
    Ok(settings)
}

/// Prints the outcome; a network that is not kept is an error.
fn report(args: &AdaptArgs, outcome: Outcome) -> Result<()> {
    if args.json {
        output::print_json(&outcome)?;
    } else {
        let mut text = outcome.to_string();
        if outcome.kept {
            let run = outcome.run.display();
            text += &format!("\nkept: {run}  (undo it with: deepfusion adapt --undo {run})\n");
        }
        output::print(&text)?;
    }
    let path = outcome.run.clone();
    let error = match outcome.refusal() {
        None => return Ok(()),
        Some(Refusal::NotJudged) => CliError::NothingJudged { path },
        Some(refusal) => {
            let worse = refusal.to_string();
            CliError::Refused { path, worse }
        }
    };
    Err(error.into())
}
