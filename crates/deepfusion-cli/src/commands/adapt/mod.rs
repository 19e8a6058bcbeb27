//! Learning on new drives from a network that is there, kept only if what can be known without ground truth gets no worse.

mod folders;
mod outcome;
mod recipe;

use std::path::Path;

use burn::tensor::Device;
use deepfusion_data::{Dataset, OpenOptions};
use deepfusion_eval::verdict::Verdict;
use deepfusion_jobs::held_out::unseen_frames;
use deepfusion_jobs::verdict::{Unseen, VerdictOptions, plan, verdict};
use deepfusion_model::{AssumedCamera, RunFolder, TrainConfig};
use deepfusion_runtime::{DepthEstimator, ModelSource};
use deepfusion_train::{TrainSummary, Trainer};

use self::folders::Folders;
use self::outcome::Outcome;
use super::recordings::{open_recordings, open_samples};
use super::start::Start;
use super::time_estimate::TimeEstimate;
use super::{clocks, device, train};
use crate::cli::{AdaptArgs, EngineArgs};
use crate::error::CliError;
use crate::failure::Result;
use crate::model::{self, ModelFacts};
use crate::progress::{Progress, say};
use crate::{engine, output};

/// Fewest held-out frames that a network is judged by.
const LEAST_FRAMES: usize = 4;

/// `deepfusion adapt`.
pub(super) fn run(args: &AdaptArgs) -> Result<()> {
    if let Some(out) = &args.undo {
        folders::undo(out)?;
        return output::print(&format!("{}\n", out.display()));
    }
    let out = args.out.as_deref().unwrap_or(Path::new("adapted"));
    let folders = Folders::of(out)?;
    let device = device::open(args.device)?;
    let given = model::chosen(args.model.as_deref())?;
    let mut before = estimator(args, &given, args.data_set.as_deref())?;
    let start = Start::from_source(&given);
    let assumed = recipe::assumed_camera(&before);
    let opened = options(args, None, assumed.as_ref());
    let ahead_s = clocks::seconds(args.clock_offset, &args.data, &opened)?;
    let mut config = recipe::config(args, &before, &device, ahead_s)?;
    start.record_in(&mut config)?;
    config.make_absolute();
    config.validate()?;
    let held_out = HeldOut::open(args, &config)?;
    let before = held_out.judge(args, &mut before)?;
    let found = &before.without_truth;
    if found.reprojection.is_none() || found.frames < LEAST_FRAMES {
        let (frames, why) = (found.frames, before.no_certificate);
        return Err(CliError::NotJudged { frames, why }.into());
    }
    let summary = learn(args, (&given, &start), config, &folders, &device)?;
    if summary.step < summary.steps {
        return Err(CliError::Stopped {
            step: summary.step,
            steps: summary.steps,
            go_on: "the same command again".into(),
        }
        .into());
    }
    let learned = ModelSource::named(folders.work())?;
    let mut learned = estimator(args, &learned, None)?;
    let after = held_out.judge(args, &mut learned)?;
    let mut outcome = Outcome::of(given.name(), summary.steps, (before, after));
    outcome.write(folders.work())?;
    outcome.run = if outcome.kept {
        folders.keep()?
    } else {
        folders.refuse()?
    };
    if args.json {
        output::print_json(&outcome)?;
    } else {
        output::print(&outcome.to_string())?;
    }
    match outcome.refusal() {
        Some(refusal) => Err(refusal.into()),
        None => Ok(()),
    }
}

fn estimator(args: &AdaptArgs, model: &ModelSource, set: Option<&str>) -> Result<DepthEstimator> {
    let mut engine = EngineArgs::on(args.device);
    engine.set = set.map(str::to_owned);
    engine::load(model, &engine)
}

/// What the network is judged on.
struct HeldOut {
    datasets: Vec<Dataset>,
    unseen: Unseen,
}

impl HeldOut {
    /// The frames that neither the given network nor the new one learns from; where that leaves none or is not known, those that
    /// the new one does not.
    fn open(args: &AdaptArgs, config: &TrainConfig) -> Result<Self> {
        let datasets = open_recordings(
            &args.data,
            &options(
                args,
                config.data.camera_ahead_s,
                config.assumed_camera.as_ref(),
            ),
        )?;
        let mut unseen = unseen_frames(config, &datasets);
        let most = VerdictOptions::default().blocks;
        if unseen == Unseen::NotKnown || plan(&datasets, &unseen, most).blocks.is_empty() {
            let mut alone = config.clone();
            (alone.init, alone.init_sha256) = (None, None);
            unseen = unseen_frames(&alone, &datasets);
            say(
                "the given network may have learned from the frames that are held out here: the figures before may be optimistic",
            );
        }
        Ok(Self { datasets, unseen })
    }

    fn judge(&self, args: &AdaptArgs, estimator: &mut DepthEstimator) -> Result<Verdict> {
        let options = VerdictOptions::new(args.speed_error / 100.0, true);
        let mut progress = Progress::new("judging without ground truth");
        Ok(verdict(
            estimator,
            &self.datasets,
            &self.unseen,
            &options,
            &mut |done, total| progress.set(done, total),
        )?)
    }
}

fn options(
    args: &AdaptArgs,
    camera_ahead_s: Option<f64>,
    assumed: Option<&AssumedCamera>,
) -> OpenOptions {
    OpenOptions {
        assumed_camera: assumed.map(AssumedCamera::intrinsics),
        camera: args.camera,
        camera_ahead_s,
        topics: args.topics.clone(),
        ..OpenOptions::default()
    }
}

/// Trains in the folder for work; goes on where that holds this very run already.
fn learn(
    args: &AdaptArgs,
    (given, start): (&ModelSource, &Start),
    config: TrainConfig,
    folders: &Folders,
    device: &Device,
) -> Result<TrainSummary> {
    let sets = open_samples(&config)?;
    let mut trainer = match folders.begun(&config)? {
        Some(folder) => Trainer::resume(config, folder, sets, device)?,
        None => {
            let folder = RunFolder::create(folders.work())?;
            folders.keep_start(given)?;
            Trainer::create(config, folder, sets, device, |model| {
                start.initialise(model, device)
            })?
        }
    };
    let time_estimate = TimeEstimate::new(trainer.config().clone(), args.device.compute());
    train::train(&mut trainer, Some(time_estimate))
}
