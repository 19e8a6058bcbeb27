//! `deepfusion perceive`: images to 3D targets, tracked over time.

mod live;

use std::path::{Path, PathBuf};

use deepfusion_hint::count_of;
use deepfusion_instances::InstanceModel;
use deepfusion_jobs::bulk::{self, DepthJob, Lock, TargetSummary, WrittenTargets};
use deepfusion_jobs::outputs::require_unwritten;
use deepfusion_jobs::{Input, TargetFinder, TargetSettings, perception_settings};
use deepfusion_perception::PerceptionConfig;

use super::live as sources;
use super::predict::{check_topics, check_watched, find_inputs, job};
use crate::cli::PerceiveArgs;
use crate::error::CliError;
use crate::failure::{Failure, Result};
use crate::model;
use crate::progress::{Progress, say};
use crate::{engine, interrupt, output};

/// `deepfusion perceive`.
pub(super) fn run(args: &PerceiveArgs) -> Result<()> {
    let prediction = &args.prediction;
    let out = &prediction.out;
    let model = model::chosen(prediction.model.as_deref())?;
    let source = sources::source(&prediction.inputs, &prediction.live)?;
    let all = match (&source, args.speed) {
        (Some(_), _) => Vec::new(),
        (None, Some(_)) => return Err(CliError::OnlyLive { option: "--speed" }.into()),
        (None, None) => find_inputs(prediction, &model)?,
    };
    check_topics(prediction, &all)?;
    check_watched(prediction, source.as_ref(), &all)?;
    let mut config = perception_settings(args.config.as_deref(), PerceptionConfig::predicted())?;
    if let Some(far) = args.max_depth {
        config.max_depth_m = far as f32;
    }
    let mut estimator = engine::load(&model, &prediction.engine)?;
    let job = job(
        prediction,
        args.outputs(f64::from(config.max_depth_m)),
        &model,
        &estimator,
    )?;
    let library = prediction.engine.ort_lib.as_deref();
    let load = |path: &PathBuf| InstanceModel::load(path, library, 0, args.masks.limits());
    let settings = TargetSettings {
        perception: config,
        instances: args.masks.instances.as_ref().map(load).transpose()?,
        scale: prediction.scale_config(),
        correct_scale: prediction.correct_scale,
        draw: args.save.clone(),
    };
    let finder = TargetFinder::open(&model, &mut estimator, settings)?;
    output::make_folder(out)?;
    // Before existing files are replaced: another run may be writing them.
    let _lock = Lock::take_whole(out)?;
    if source.is_some() {
        deepfusion_jobs::live::make_room(out, prediction.overwrite)?;
    }
    // No file is overwritten unless asked, whichever program wrote it.
    if !prediction.overwrite {
        require_unwritten(&job.writer, &args.save, &all)?;
    }
    interrupt::catch("stopping after the current frames");
    match source {
        Some(address) => live::run(args, &job, finder, &address),
        None => perceive_images(args, &job, finder, &all),
    }
}

/// Finds the targets of existing images.
fn perceive_images(
    args: &PerceiveArgs,
    job: &DepthJob<'_>,
    finder: TargetFinder<'_>,
    all: &[Input],
) -> Result<()> {
    let mut shown = Progress::new("perceiving");
    let written = |frame: WrittenTargets<'_>| -> Result<()> {
        if args.json {
            output::print(frame.line)?;
        }
        shown.set(frame.done, frame.total);
        Ok(())
    };
    let summary = bulk::perceive(job, finder, all, &interrupt::asked, written);
    // Removes the bar before anything else is printed.
    drop(shown);
    report(&args.prediction.out, summary?)
}

/// Prints how many frames and targets were written; an error if some frames are not done.
fn report(out: &Path, summary: TargetSummary<Failure>) -> Result<()> {
    let median = summary.median_latency_ms();
    let TargetSummary {
        done,
        total,
        targets,
        mut unreadable,
        stopped_by,
        ..
    } = summary;
    if let Some(error) = stopped_by {
        return Err(error);
    }
    if done == 0 && total == 1 && unreadable.len() == 1 {
        return Err(unreadable.remove(0));
    }
    say(&format!(
        "{}, {} written to {}{}",
        count_of(done, "frame"),
        count_of(targets, "target"),
        out.display(),
        median.map_or(String::new(), |ms| format!(
            ", {ms:.0} ms from file to targets (median)"
        ))
    ));
    let resumes = done == 0;
    if !unreadable.is_empty() {
        return Err(CliError::SomeFailed {
            hint: unreadable.iter().find_map(Failure::hint),
            failures: unreadable.iter().map(Failure::one_line).collect(),
            total,
            interrupted: interrupt::asked(),
            resumes,
        }
        .into());
    }
    if done < total {
        return Err(CliError::Interrupted {
            done,
            total,
            resumes,
        }
        .into());
    }
    Ok(())
}
