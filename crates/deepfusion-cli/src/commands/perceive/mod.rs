//! `deepfusion perceive`: images to 3D targets, followed over time.

mod live;

use std::path::PathBuf;
use std::sync::Mutex;
use std::time::Instant;

use deepfusion_hint::count_of;
use deepfusion_instances::InstanceModel;
use deepfusion_jobs::bulk::pipeline::{self, Threads};
use deepfusion_jobs::bulk::{
    RecordLines, record_line, record_lines_path, record_path, write_record,
};
use deepfusion_jobs::outputs::require_unwritten;
use deepfusion_jobs::scene::MotionTracker;
use deepfusion_jobs::{
    Input, PerceivedFrame, StartedFrame, TargetFinder, TargetSettings, perception_settings,
};
use deepfusion_perception::PerceptionConfig;

use super::live as sources;
use super::predict::{Job, check_watched, find_inputs, warn_of_drift};
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
    check_watched(prediction, source.as_ref(), &all)?;
    let mut config = perception_settings(args.config.as_deref(), PerceptionConfig::predicted())?;
    if let Some(far) = args.max_depth {
        config.max_depth_m = far as f32;
    }
    let mut estimator = engine::load(&model, &prediction.engine)?;
    let job = Job::new(
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
    if source.is_some() {
        deepfusion_jobs::live::make_room(out, prediction.overwrite)?;
    }
    // Nothing is overwritten unless asked, whoever wrote it.
    if !prediction.overwrite {
        require_unwritten(&job.writer, &args.save, &all)?;
    }
    interrupt::catch("stopping after the frames at work");
    let work = Work {
        args,
        job: &job,
        all: &all,
        lines: Mutex::new(RecordLines::begin(&record_lines_path(out))?),
        progress: Mutex::new(source.is_none().then(|| Progress::new("perceiving"))),
        outcome: Mutex::new(Outcome::default()),
    };
    match source {
        Some(address) => work.go_live(&address, finder),
        None => work.go(finder),
    }
}

/// What was found in a frame; it is said where metres have drifted.
fn found(frame: Result<PerceivedFrame, deepfusion_jobs::Error>) -> Result<PerceivedFrame> {
    let frame = frame?;
    if let Some(ratio) = frame.drift {
        warn_of_drift(&frame.input.name, ratio);
    }
    Ok(frame)
}

/// What became of the frames.
#[derive(Default)]
struct Outcome {
    done: usize,
    targets: usize,
    latency_ms: Vec<f64>,
    unreadable: Vec<Failure>,
    fatal: Option<Failure>,
}

struct Work<'a> {
    args: &'a PerceiveArgs,
    job: &'a Job<'a>,
    all: &'a [Input],
    lines: Mutex<RecordLines>,
    /// None of a live source, which has figures of its own.
    progress: Mutex<Option<Progress>>,
    outcome: Mutex<Outcome>,
}

impl Work<'_> {
    fn go(self, mut finder: TargetFinder) -> Result<()> {
        let mut motions = MotionTracker::default();
        let load = |index: usize| {
            let start = Instant::now();
            let input = self.all[index].clone();
            match self.job.load(&input) {
                Ok((loaded, prepared)) => Some(StartedFrame {
                    input,
                    loaded,
                    prepared,
                    start,
                }),
                Err(error) => {
                    self.outcome().unreadable.push(error);
                    None
                }
            }
        };
        let look = |started: StartedFrame| {
            let motion = motions.next(&started.input);
            found(finder.next(started, motion))
        };
        let write = |_: usize, found: Result<PerceivedFrame>| {
            if let Err(error) = found.and_then(|found| self.write(&found)) {
                self.outcome().fatal.get_or_insert(error);
            }
        };
        let stop = || interrupt::asked() || self.outcome().fatal.is_some();
        // One thread reads and one writes: frames stay in their order.
        let threads = Threads {
            before: 1,
            after: 1,
        };
        pipeline::run(self.all.len(), threads, &stop, &load, look, &write);
        self.finish()
    }

    fn outcome(&self) -> std::sync::MutexGuard<'_, Outcome> {
        // A thread that panicked ends the program with its own message.
        self.outcome.lock().unwrap_or_else(|e| e.into_inner())
    }

    fn write(&self, found: &PerceivedFrame) -> Result<()> {
        let (out, input) = (&self.args.prediction.out, &found.input);
        for (save, picture) in &found.pictures {
            picture.save(&save.path(out, &input.name))?;
        }
        self.job.writer.write(input, &found.loaded, &found.seen)?;
        write_record(&found.record, &record_path(out, &input.name))?;
        let line = record_line(&found.record)?;
        self.lines
            .lock()
            .unwrap_or_else(|e| e.into_inner())
            .add(&line)?;
        let live = found.loaded.live.is_some();
        if self.args.json && !live {
            output::print(&line)?;
        }
        let mut outcome = self.outcome();
        outcome.done += 1;
        let mut progress = self.progress.lock().unwrap_or_else(|e| e.into_inner());
        if let Some(progress) = &mut *progress {
            progress.set(outcome.done + outcome.unreadable.len(), self.all.len());
        }
        outcome.targets += found.record.targets.len();
        if !live {
            outcome.latency_ms.extend(found.record.latency_ms);
        }
        Ok(())
    }

    fn finish(self) -> Result<()> {
        // The bar is gone before anything else is printed.
        drop(self.progress);
        let lines = self.lines.into_inner().unwrap_or_else(|e| e.into_inner());
        let mut outcome = self.outcome.into_inner().unwrap_or_else(|e| e.into_inner());
        // What is there stays: a stopped run's lines are of its frames.
        match outcome.done {
            0 => lines.discard(),
            _ => lines.finish()?,
        }
        if let Some(error) = outcome.fatal {
            return Err(error);
        }
        let total = self.all.len();
        if outcome.done == 0 && total == 1 && outcome.unreadable.len() == 1 {
            return Err(outcome.unreadable.remove(0));
        }
        outcome.latency_ms.sort_by(f64::total_cmp);
        let median = outcome.latency_ms.get(outcome.done / 2).copied();
        say(&format!(
            "{}, {} written to {}{}",
            count_of(outcome.done, "frame"),
            count_of(outcome.targets, "target"),
            self.args.prediction.out.display(),
            median.map_or(String::new(), |ms| format!(
                ", {ms:.0} ms from file to targets (median)"
            ))
        ));
        if !outcome.unreadable.is_empty() {
            return Err(CliError::SomeFailed {
                hint: outcome.unreadable.iter().find_map(Failure::hint),
                failures: outcome.unreadable.iter().map(Failure::one_line).collect(),
                total,
                interrupted: interrupt::asked(),
                resumes: outcome.done == 0,
            }
            .into());
        }
        if outcome.done < total {
            return Err(CliError::Interrupted {
                done: outcome.done,
                total,
                resumes: outcome.done == 0,
            }
            .into());
        }
        Ok(())
    }
}
