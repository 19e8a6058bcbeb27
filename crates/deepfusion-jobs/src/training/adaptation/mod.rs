//! Adapts a network to new drives, and keeps the result only if no measure without ground truth gets worse.
//!
//! [`Adaptation::begin`] judges the given network on the end of each drive, which is held out. The caller runs the [`Adaptation::trainer`],
//! and [`Adaptation::end`] judges the adapted network on the same frames: it becomes the run `out`, or is set aside. [`undo`] restores the
//! network from before.

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

/// Smallest number of held-out frames for judging a network.
const LEAST_FRAMES: usize = 4;

/// What to adapt to, and how.
#[derive(Debug, Clone)]
pub struct AdaptSettings {
    /// Drives with a speed.
    pub data: Vec<PathBuf>,
    /// Folder of the adapted network's run, which must be new.
    pub out: PathBuf,
    /// The cameras to use. If both are used and rectified, each is by default a second view of the same moment, unless the given network
    /// was trained on drives without that.
    pub camera: Cameras,
    /// The topics chosen for bags.
    pub topics: Vec<NamedTopic>,
    /// How far the camera's clock is ahead of the vehicle's, in seconds; `None`: as the recordings say.
    pub camera_ahead_s: Option<f64>,
    /// Number of training steps.
    pub steps: usize,
    /// Number of the drives' samples in a step.
    pub batch: usize,
    /// Number of samples with simulated depth in a step, which preserve what the network already knows; 0: none, and no uncertainty head.
    pub simulated: usize,
    /// Whether the simulated views are rendered through the drives' own cameras, at their height above the road as measured in the images;
    /// otherwise through random cameras.
    pub own_camera: bool,
    /// The largest learning rate.
    pub learning_rate: f64,
    /// The share at the end of each drive to judge on.
    pub held_out: f64,
    /// Standard error of the vehicle's speed, as a share of it.
    pub speed_sd: f64,
    /// Seed of everything random.
    pub seed: u64,
    /// Assignments to any key of the configuration, such as `loss.smoothness=0.01`, which take precedence ([`TrainConfig::set`]).
    pub set: Vec<String>,
    /// The kind of device.
    pub compute: Compute,
}

impl AdaptSettings {
    /// 240 steps of three samples of these drives and two simulated ones; the last quarter of each drive is held out.
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

    /// The options for opening the drives, for a network with this assumed camera.
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

/// Checks that the folder for an adapted network is new, before the long work rather than after it.
///
/// # Errors
/// [`Error::AdaptedBefore`], [`Error::MountPoint`]; a link to nothing.
pub fn require_new(out: &Path) -> Result<()> {
    Folders::of(out).map(|_| ())
}

/// Called with the options and the open recordings of a set, as by [`open_samples`].
pub type OpenedCallback<'a> = &'a mut dyn FnMut(&OpenOptions, &[Dataset]);

/// An adaptation whose given network has been judged.
pub struct Adaptation {
    settings: AdaptSettings,
    folders: Folders,
    given: ModelSource,
    start: Start,
    config: TrainConfig,
    device: Device,
    held_out: HeldOut,
    before: Verdict,
    /// The lock on the training's folder, once training has begun.
    lock: Mutex<Option<RunLock>>,
}

impl Adaptation {
    /// Judges the given network, run by `estimator`. `opened` is called with the recordings; `progress` receives the number of frames done,
    /// and of all.
    ///
    /// # Errors
    /// [`Error::AdaptedBefore`] if `out` is not new; [`Error::NotJudged`] if there are too few usable held-out frames; drives that cannot
    /// be opened; settings that contradict each other.
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

    /// The cameras that simulated views are rendered through; empty: random ones.
    #[must_use]
    pub fn simulated_cameras(&self) -> &[SimulatedCamera] {
        let sets = self.config.data.sets.iter();
        let mut simulated = sets.filter_map(|set| set.simulated.as_ref());
        simulated.next().map_or(&[], |views| &views.cameras)
    }

    /// Whether the given network may have been trained on the held-out frames, so that its figures may be too optimistic.
    #[must_use]
    pub fn may_have_seen_held_out(&self) -> bool {
        self.held_out.maybe_seen
    }

    /// The trainer; it continues an interrupted adaptation with the same settings.
    ///
    /// # Errors
    /// [`Error::OtherSettings`] if an interrupted adaptation had other settings; [`Error::RunBusy`] if another process is training there; as
    /// [`open_samples`]; errors of the trainer.
    pub fn trainer(
        &self,
        opened: OpenedCallback,
        warn: &mut dyn FnMut(SampleWarning),
        report: &mut dyn FnMut(StartReport),
    ) -> Result<Trainer> {
        let sets = open_samples(&self.config, opened, warn)?;
        let config = self.config.clone();
        self.hold(None);
        // Before any of its files is removed.
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

    /// Keeps other processes out of the training's folder.
    fn hold(&self, lock: Option<RunLock>) {
        let mut held = self.lock.lock().unwrap_or_else(PoisonError::into_inner);
        *held = lock;
    }

    /// The folder of the training run, until it is judged.
    #[must_use]
    pub fn work(&self) -> &Path {
        self.folders.work()
    }

    /// Judges the network after this many steps, run by `learned`, and keeps it or sets it aside.
    ///
    /// # Errors
    /// An image that cannot be read; folders that cannot be written.
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

/// The frames that a network is judged on.
struct HeldOut {
    datasets: Vec<Dataset>,
    unseen: Unseen,
    maybe_seen: bool,
}

impl HeldOut {
    /// The frames that neither the given nor the adapted network learns from. If there are none, or if that is unknown, the frames that the
    /// adapted one does not learn from.
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
