//! Learning on new drives from a network that is there, kept only if what can be known without ground truth gets no worse.
//!
//! [`Adaptation::begin`] judges the given network on the end of each drive, which is held out. The caller runs the
//! [`Adaptation::trainer`], and [`Adaptation::end`] judges what was learned on the same frames: it becomes the run `out`, or is laid
//! aside. [`undo`] takes a kept one back.

mod cameras;
mod folders;
mod outcome;
mod recipe;

use std::path::{Path, PathBuf};
use std::sync::{Mutex, PoisonError};

use deepfusion_data::{Cameras, Dataset, NamedTopic, OpenOptions};
use deepfusion_eval::verdict::Verdict;
use deepfusion_model::{AssumedCamera, Compute, RunFolder, SimulatedCamera, TrainConfig};
use deepfusion_runtime::{DepthEstimator, ModelSource};
use deepfusion_train::{Device, Trainer};

pub use self::folders::undo;
pub use self::outcome::{Outcome, Refusal};
pub use self::recipe::assumed_camera;

use self::folders::Folders;
use super::{RunLock, Start, StartReport};
use crate::held_out::unseen_frames;
use crate::model_facts::ModelFacts as _;
use crate::recordings::{open_aimed, open_with_turns};
use crate::samples::{SampleWarning, open_samples};
use crate::verdict::{SPEED_SD, Unseen, VerdictOptions, plan, verdict};
use crate::{Error, Result};

/// Fewest held-out frames that a network is judged by.
const LEAST_FRAMES: usize = 4;

/// What to learn on, and how.
#[derive(Debug, Clone)]
pub struct AdaptSettings {
    /// Drives with a speed.
    pub data: Vec<PathBuf>,
    /// Folder of the adapted network's run, which must be new.
    pub out: PathBuf,
    /// Which cameras of the drives. Of both, where they are rectified, each is by default a second view of the same moment, unless the given
    /// network learned from drives without that.
    pub camera: Cameras,
    /// For bags: topics that are named.
    pub topics: Vec<NamedTopic>,
    /// How far the camera's clock is ahead of the vehicle's, in seconds; `None`: as the recordings say.
    pub camera_ahead_s: Option<f64>,
    /// Steps of learning.
    pub steps: usize,
    /// Samples of the drives a step.
    pub batch: usize,
    /// Samples of simulated depth a step, which keep what the network knows already; 0: none, and no head for uncertainty.
    pub simulated: usize,
    /// Whether the simulated views are seen through the drives' own cameras, at the height of the road in their images; else through
    /// any camera.
    pub own_camera: bool,
    /// The largest learning rate.
    pub learning_rate: f64,
    /// Share of each drive's end to judge on.
    pub held_out: f64,
    /// One standard error of the vehicle's speed, as a share of it.
    pub speed_sd: f64,
    /// Fixes everything that is random.
    pub seed: u64,
    /// Any key of the configuration over these, as `loss.smoothness=0.01` ([`TrainConfig::set`]).
    pub set: Vec<String>,
    /// What it learns on.
    pub compute: Compute,
}

impl AdaptSettings {
    /// 240 steps of three samples of these drives and two simulated ones, the last quarter of each drive held out.
    #[must_use]
    pub fn new(data: Vec<PathBuf>, out: PathBuf) -> Self {
        Self {
            data,
            out,
            camera: Cameras::default(),
            topics: Vec::new(),
            camera_ahead_s: None,
            steps: 240,
            batch: 3,
            simulated: 2,
            own_camera: true,
            learning_rate: 5e-5,
            held_out: 0.25,
            speed_sd: SPEED_SD,
            seed: 0,
            set: Vec::new(),
            compute: Compute::Processor,
        }
    }

    /// How the drives are opened for a network with this assumed camera.
    #[must_use]
    pub fn open_options(&self, assumed: Option<&AssumedCamera>) -> OpenOptions {
        OpenOptions {
            assumed_camera: assumed.map(AssumedCamera::intrinsics),
            camera: self.camera,
            camera_ahead_s: self.camera_ahead_s,
            topics: self.topics.clone(),
            ..OpenOptions::default()
        }
    }
}

/// Fails where a folder for an adapted network is not new: an error before long work, not after it.
///
/// # Errors
/// [`Error::AdaptedBefore`], [`Error::MountPoint`]; a link to nothing.
pub fn require_new(out: &Path) -> Result<()> {
    Folders::of(out).map(|_| ())
}

/// Called with the recordings of a set when they are open, and with how they were opened, as by [`open_samples`].
pub type OpenedCallback<'a> = &'a mut dyn FnMut(&OpenOptions, &[Dataset]);

/// An adaptation that was begun: the given network is judged.
pub struct Adaptation {
    settings: AdaptSettings,
    folders: Folders,
    given: ModelSource,
    start: Start,
    config: TrainConfig,
    device: Device,
    held_out: HeldOut,
    before: Verdict,
    /// Of the folder where is learned, once that has begun.
    lock: Mutex<Option<RunLock>>,
}

impl Adaptation {
    /// Judges the given network, which `estimator` runs. `opened` sees the recordings, `progress` the frames done and in all.
    ///
    /// # Errors
    /// [`Error::AdaptedBefore`] where `out` is not new; [`Error::NotJudged`] where the held-out frames say too little; drives that cannot
    /// be opened, and settings that contradict each other.
    pub fn begin(
        given: ModelSource,
        settings: AdaptSettings,
        estimator: &mut DepthEstimator,
        device: &Device,
        opened: OpenedCallback,
        progress: &mut dyn FnMut(usize, usize),
    ) -> Result<Self> {
        let folders = Folders::of(&settings.out)?;
        let start = Start::from_source(&given);
        let options = settings.open_options(assumed_camera(estimator).as_ref());
        let open = if recipe::takes_measured_turns_only(&settings, estimator)? {
            open_aimed
        } else {
            open_with_turns
        };
        let drives = open(&settings.data, &options)?;
        opened(&options, &drives);
        let mut config = recipe::config(&settings, estimator, device, &drives)?;
        start.record_in(&mut config)?;
        config.make_absolute();
        config.validate()?;
        let held_out = HeldOut::of(drives, &config);
        let before = held_out.judge(&settings, estimator, progress)?;
        let found = &before.without_truth;
        if found.reprojection.is_none() || found.frames < LEAST_FRAMES {
            let (frames, why) = (found.frames, before.no_certificate);
            return Err(Error::NotJudged { frames, why });
        }
        Ok(Self {
            settings,
            folders,
            given,
            start,
            config,
            device: device.clone(),
            held_out,
            before,
            lock: Mutex::default(),
        })
    }

    /// The cameras that simulated views are seen through; none: any.
    #[must_use]
    pub fn simulated_cameras(&self) -> &[SimulatedCamera] {
        let sets = self.config.data.sets.iter();
        let mut simulated = sets.filter_map(|set| set.simulated.as_ref());
        simulated.next().map_or(&[], |views| &views.cameras)
    }

    /// Whether the given network may have learned from the frames that are held out: the figures before may then be optimistic.
    #[must_use]
    pub fn may_have_seen_held_out(&self) -> bool {
        self.held_out.maybe_seen
    }

    /// What learns; it goes on where an adaptation with the same settings was interrupted.
    ///
    /// # Errors
    /// [`Error::OtherSettings`] where one with other settings was; [`Error::AtWork`] where another process learns there; as [`open_samples`],
    /// and the trainer's.
    pub fn trainer(
        &self,
        opened: OpenedCallback,
        warn: &mut dyn FnMut(SampleWarning),
        report: &mut dyn FnMut(StartReport),
    ) -> Result<Trainer> {
        let sets = open_samples(&self.config, opened, warn)?;
        let config = self.config.clone();
        self.hold(None);
        // Before anything of it is removed.
        let lock = self.folders.lock()?;
        Ok(match self.folders.begun(&config)? {
            Some(folder) => {
                self.hold(lock);
                Trainer::resume(config, folder, sets, &self.device)?
            }
            None => {
                let folder = RunFolder::create(self.folders.work())?;
                self.hold(self.folders.lock()?);
                self.folders.keep_start(&self.given)?;
                Trainer::create(config, folder, sets, &self.device, |model| {
                    self.start.initialise(model, &self.device, report)
                })?
            }
        })
    }

    /// Keeps other processes out of the folder where is learned.
    fn hold(&self, lock: Option<RunLock>) {
        let mut held = self.lock.lock().unwrap_or_else(PoisonError::into_inner);
        *held = lock;
    }

    /// The run that the trainer writes, until it is judged.
    #[must_use]
    pub fn work(&self) -> &Path {
        self.folders.work()
    }

    /// Judges what was learned in so many steps, which `learned` runs, and keeps it or lays it aside.
    ///
    /// # Errors
    /// An image that cannot be read, and folders that cannot be written.
    pub fn end(
        self,
        steps: usize,
        learned: &mut DepthEstimator,
        progress: &mut dyn FnMut(usize, usize),
    ) -> Result<Outcome> {
        let after = self.held_out.judge(&self.settings, learned, progress)?;
        let from = self.given.name();
        let mut outcome = Outcome::of(from, steps, (self.before, after));
        outcome.write(self.folders.work())?;
        outcome.run = if outcome.kept {
            self.folders.keep()?
        } else {
            self.folders.refuse()?
        };
        Ok(outcome)
    }
}

/// What the network is judged on.
struct HeldOut {
    datasets: Vec<Dataset>,
    unseen: Unseen,
    maybe_seen: bool,
}

impl HeldOut {
    /// The frames that neither the given network nor the new one learns from; where that leaves none or is not known, those that
    /// the new one does not.
    fn of(datasets: Vec<Dataset>, config: &TrainConfig) -> Self {
        let mut unseen = unseen_frames(config, &[], &datasets);
        let most = VerdictOptions::default().blocks;
        let maybe_seen =
            unseen == Unseen::NotKnown || plan(&datasets, &unseen, most).blocks.is_empty();
        if maybe_seen {
            let mut alone = config.clone();
            (alone.init, alone.init_sha256) = (None, None);
            unseen = unseen_frames(&alone, &[], &datasets);
        }
        Self {
            datasets,
            unseen,
            maybe_seen,
        }
    }

    fn judge(
        &self,
        settings: &AdaptSettings,
        estimator: &mut DepthEstimator,
        progress: &mut dyn FnMut(usize, usize),
    ) -> Result<Verdict> {
        let options = VerdictOptions::new(settings.speed_sd, true);
        verdict(estimator, &self.datasets, &self.unseen, &options, progress)
    }
}
