//! `deepfusion predict`: images to metric depth, in bulk.

mod inspection;
mod live;
mod warnings;

use std::fmt::Display;
use std::path::PathBuf;

use deepfusion_data::OpenOptions;
use deepfusion_hint::count_of;
use deepfusion_jobs::bulk::{
    self, BulkProgress, CameraSource, DepthJob, DepthSettings, GivenCamera, Lock, StartedJob,
    Summary, write_videos,
};
use deepfusion_jobs::outputs::{DepthOutput, DepthOutputs, without_outputs};
use deepfusion_jobs::scene::unwatched;
use deepfusion_jobs::{Error, Input, first_of_each};
use deepfusion_runtime::{DepthEstimator, ModelSource};
use deepfusion_video::{Address, can_write_video};

use super::live as sources;
use super::warnings as recordings;
use crate::cli::{CameraIntrinsics, PredictArgs, PredictionArgs, Shard};
use crate::error::CliError;
use crate::failure::{Failure, Result};
use crate::model;
use crate::progress::{Progress, say};
use crate::{engine, interrupt, output};

/// `deepfusion predict`.
pub(super) fn run(args: &PredictArgs) -> Result<()> {
    let PredictArgs {
        prediction, shard, ..
    } = args;
    let out = &prediction.out;
    check_videos(args)?;
    let model = model::chosen(prediction.model.as_deref())?;
    if let Some(address) = sources::source(&prediction.inputs, &prediction.live)? {
        return live::run(args, &model, &address);
    }
    let all = find_inputs(prediction, &model)?;
    check_topics(prediction, &all)?;
    check_watched(prediction, None, &all)?;
    if prediction.correct_scale && *shard != Shard::WHOLE {
        return Err(CliError::CorrectShard.into());
    }
    let mine: Vec<&Input> = shard.select(&all).collect();
    let mut estimator = engine::load(&model, &prediction.engine)?;
    let job = job(prediction, args.outputs(), &model, &estimator)?;
    let camera_known = !matches!(job.loader.camera, CameraSource::Unknown);
    if args.cloud() && !(camera_known || all.iter().all(|input| input.frame.is_some())) {
        return Err(Error::NoCamera.into());
    }
    output::make_folder(out)?;
    interrupt::catch("stopping after the current images; the same command continues from there");
    let _lock = Lock::take(out, *shard)?;
    let StartedJob {
        manifest,
        sidecars,
        todo,
    } = job
        .bulk(*shard, prediction.overwrite, args.video())
        .begin(&all, &mine, args.json)?;
    let mut shown = Progress::new("predicting");
    let watcher = |done, total| shown.set(done, total);
    let progress = BulkProgress::new(out, manifest, sidecars, Failure::one_line, watcher);
    let stop = &interrupt::asked;
    bulk::predict(&job, &mut estimator, &mine, &todo, &progress, stop);
    let mut summary = progress.finish();
    drop(shown);
    let sidecars = std::mem::take(&mut summary.sidecars);
    let (there, done) = (mine.len() - todo.len(), summary.done);
    // A full disk is reported once, as the reason for stopping.
    let outcome = outcome(summary)?;
    if outcome.is_ok() || done > there {
        say(&format!(
            "{} written to {}{}",
            count_of(done - there, "image"),
            out.display(),
            if there > 0 {
                format!(", {there} existed already")
            } else {
                String::new()
            }
        ));
    }
    if args.json {
        output::print_json(&sidecars)?;
    }
    outcome?;
    if args.video() {
        let written = write_videos(out, &all, DepthOutput::SideBySide.ending());
        print_videos(&written?);
    }
    Ok(())
}

/// The inner error if not all images of a run are done, to be returned after the summary; the outer one if the manifest could not be written.
fn outcome(summary: Summary<Failure>) -> Result<Result<()>> {
    let Summary {
        done,
        total,
        mut failures,
        stopped_by,
        manifest,
        ..
    } = summary;
    let failed = failures.len();
    if let Some(error) = stopped_by {
        return Ok(Err(error));
    }
    if failed == 1 && total == 1 {
        return Ok(Err(failures.remove(0).1));
    }
    if failed > 0 {
        let error = CliError::SomeFailed {
            hint: failures.iter().find_map(|(_, error)| error.hint()),
            failures: failures.iter().map(|(_, error)| error.one_line()).collect(),
            total,
            interrupted: interrupt::asked() && done + failed < total,
            resumes: true,
        };
        return Ok(Err(error.into()));
    }
    if done < total {
        let resumes = true;
        return Ok(Err(CliError::Interrupted {
            done,
            total,
            resumes,
        }
        .into()));
    }
    manifest?;
    Ok(Ok(()))
}

/// The images that the arguments name; warnings of recordings among them are printed.
pub(super) fn find_inputs(args: &PredictionArgs, model: &ModelSource) -> Result<Vec<Input>> {
    let options = OpenOptions {
        assumed_camera: model.assumed_camera(args.engine.set.as_deref())?,
        ..args.open_options()
    };
    let found = deepfusion_jobs::find_inputs(&args.inputs, &options, recordings::print)?;
    let images = found.len();
    let found = without_outputs(found, &args.out);
    if found.is_empty() && images > 0 {
        let input = args.inputs.join(" ");
        return Err(CliError::OutputsAlone { input }.into());
    }
    // After the images got their names, which do not depend on this option.
    Ok(match args.frames {
        Some(most) => first_of_each(found, usize::try_from(most).unwrap_or(usize::MAX)),
        None => found,
    })
}

/// Refuses topics for inputs without a recording among them, where they would silently have no effect. Other recordings than bags refuse
/// them when they are opened.
///
/// # Errors
/// [`CliError::NoTopics`].
pub(super) fn check_topics(args: &PredictionArgs, inputs: &[Input]) -> Result<(), CliError> {
    match args.topics.first() {
        Some(topic) if inputs.iter().all(|input| input.frame.is_none()) => {
            Err(CliError::NoTopics {
                input: args.inputs.join(" "),
                topic: topic.clone(),
            })
        }
        _ => Ok(()),
    }
}

/// Refuses the scale monitor's options for inputs that it cannot monitor, where they would silently have no effect.
///
/// # Errors
/// [`CliError::Unwatched`].
pub(super) fn check_watched(
    args: &PredictionArgs,
    source: Option<&Address>,
    inputs: &[Input],
) -> Result<(), CliError> {
    let option = match args {
        args if args.correct_scale => "--correct-scale",
        args if args.camera_height.is_some() => "--camera-height",
        _ => return Ok(()),
    };
    let unwatched_for = |input: &dyn Display, why: &dyn Display| CliError::Unwatched {
        option,
        input: input.to_string(),
        why: why.to_string(),
    };
    if let Some(address) = source {
        return Err(unwatched_for(
            address,
            &"a live source has no measured motion",
        ));
    }
    match unwatched(inputs) {
        Some((input, why)) => Err(unwatched_for(&input, &why)),
        None => Ok(()),
    }
}

/// Checks before the work begins that videos can be written at its end.
fn check_videos(args: &PredictArgs) -> Result<()> {
    if !args.video() {
        return Ok(());
    }
    if args.shard != Shard::WHOLE {
        return Err(CliError::VideoShard.into());
    }
    Ok(can_write_video(&args.prediction.out)?)
}

/// Prints which videos were written, and how many frames each has.
fn print_videos(videos: &[(PathBuf, usize)]) {
    for (path, frames) in videos {
        say(&format!(
            "{}: {}",
            path.display(),
            count_of(*frames, "frame")
        ));
    }
}

/// The work that the arguments ask of a network.
pub(super) fn job<'a>(
    args: &'a PredictionArgs,
    outputs: DepthOutputs,
    model: &'a ModelSource,
    estimator: &DepthEstimator,
) -> Result<DepthJob<'a>> {
    recordings::warn_of_hfov(args.hfov);
    let (settings, out) = (settings(args), &args.out);
    // Checked first, so that no second network is opened for `show_layers` of a job that is refused.
    if outputs.need_uncertainty() && !estimator.predicts_uncertainty() {
        return Err(Error::NoUncertainty.into());
    }
    let show_layers = if outputs.need_layers() {
        let network = model.load(args.engine.set.as_deref())?;
        Some(inspection::open(&network, args.engine.device)?)
    } else {
        None
    };
    let warn = &warnings::print;
    let job = DepthJob::new(settings, out, outputs, model, estimator, show_layers, warn)?;
    model::warn_of_one_size(model, estimator.config(), args.post_process);
    Ok(job)
}

/// The settings of the options for predicting depth.
fn settings(args: &PredictionArgs) -> DepthSettings {
    let numbers = args.intrinsics.map(CameraIntrinsics::numbers);
    let hfov = args.hfov.map(GivenCamera::Hfov);
    let camera = hfov.or(numbers.map(GivenCamera::Numbers));
    DepthSettings {
        camera: camera.or_else(|| args.calib.clone().map(GivenCamera::File)),
        focal_correction: !args.no_focal_correction,
        stretch: args.stretch,
        post_process: args.post_process,
        scale: args.scale_config(),
        correct_scale: args.correct_scale,
        set: args.engine.set.clone(),
        topics: args.topics.clone(),
        precision: args.engine.precision,
        device: args.engine.device.to_string(),
    }
}
