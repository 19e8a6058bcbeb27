use crate::focal_spread::focal_spread;
use crate::learned_focal::{self, LearnedFocal, check_camera};
use crate::losses::speed_weight;
use crate::model::displacement_ratio;
use crate::selection::selection;
use crate::workers::{Alone, Crew, Workers};
use crate::{
    Adam, BatchLoader, BatchLoss, Checkpoint, CheckpointKind, Checkpoints, Control, DepthBatch,
    DepthLoader, DepthPass, Error, ForwardPass, LearningRateSchedule, LossTerms, Model,
    NamedGradients, RunFolder, SamplePanel, SampleSet, Sampler, Schedule, StepOutcome, TrainConfig,
    TrainEvent,
};
use burn::tensor::{Device, Tensor};
use deepfusion_kernels::AdamStep;
use deepfusion_model::{Error as ModelError, LearnedCamera, SetFindings, TrainFindings};
use deepfusion_nn::ops::{Precision, autocast, supports};
use deepfusion_nn::weights::{apply, collect};
use std::hash::{DefaultHasher, Hash, Hasher};
use std::path::Path;
use std::time::{Duration, Instant};

/// Said where the spread is large.
const CAMERA_NOT_TOLD: &str = "the drives do not tell the camera's focal length: without turns (and, with the turns of a network, without strong ones) \
     another focal length explains the images as well; depth of what is not straight ahead is not to be relied on, nor its metres";
/// The name of the focal length among parameters and moments.
pub(crate) const FOCAL: &str = "focal";
/// Skipped steps in a row after which training gives up.
const MAX_SKIPPED: usize = 20;
/// Share of the learning rate at which the cosine schedule ends.
const COSINE_END: f64 = 0.01;
/// Number of steps over which the pace and the scale ratio are averaged.
const SMOOTHING: f64 = 20.0;
/// Below this share of pixels in view the geometry has diverged: a warning.
const MIN_VALID_SHARE: f64 = 0.2;
/// Above this share of dynamic pixels the masks remove too much of what depth should learn from: a warning.
const MAX_MOVING_SHARE: f64 = 0.4;

/// A training run.
pub struct Trainer {
    config: TrainConfig,
    folder: RunFolder,
    device: Device,
    model: Model,
    adam: Adam,
    state: Checkpoint,
    train: SampleSet,
    validation: SampleSet,
    workers: Crew,
}

/// How a run ended.
#[derive(Debug, Clone, PartialEq)]
pub struct TrainSummary {
    /// Steps done.
    pub step: usize,
    /// Steps of the whole run.
    pub steps: usize,
    /// Steps skipped for a gradient that was not finite.
    pub skipped: usize,
    /// The lowest value of the quantity that selects `best`.
    pub best_validation: Option<f64>,
    /// Wall time of this call, in seconds.
    pub seconds: f64,
    /// Whether the listener asked to stop before the end.
    pub stopped: bool,
}

impl std::fmt::Debug for Trainer {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Trainer")
            .field("folder", &self.folder)
            .field("state", &self.state)
            .finish_non_exhaustive()
    }
}

impl Trainer {
    ///
    /// # Errors
    /// [`Error::Model`], [`Error::NoSamples`], [`Error::NoValidation`].
    pub fn create(
        config: TrainConfig,
        folder: RunFolder,
        sets: (SampleSet, SampleSet),
        device: &Device,
        init: impl FnOnce(Model) -> Result<Model, Error>,
    ) -> Result<Self, Error> {
        Self::create_among(Box::new(Alone), config, folder, sets, device, init)
    }

    /// As [`Self::create`], one of several [`Workers`]; `config.batch` and `config.accumulate` are each worker's. Worker 0 alone writes
    /// into the folder.
    ///
    /// # Errors
    /// As [`Self::create`].
    pub fn create_among(
        workers: Box<dyn Workers>,
        mut config: TrainConfig,
        folder: RunFolder,
        (train, validation): (SampleSet, SampleSet),
        device: &Device,
        init: impl FnOnce(Model) -> Result<Model, Error>,
    ) -> Result<Self, Error> {
        let workers = Crew::of(workers);
        config.validate()?;
        check_precision(&config, device)?;
        config.make_absolute();
        check_samples(&config, &train, &validation)?;
        check_camera(&config, [&train, &validation])?;
        let settings = config;
        let findings = findings(&settings, &train);
        let config = findings.complete(settings.clone());
        let device = device.clone().autodiff();
        let model = init(Model::new(&config, &device)?)?;
        if workers.leads() {
            folder.write_config(&settings, &findings)?;
        }
        Ok(Self {
            config,
            folder,
            device,
            model,
            adam: Adam::default(),
            state: Checkpoint {
                step: 0,
                best_validation: None,
                skipped: 0,
                encoders_only: false,
                focal_ratio: None,
            },
            train,
            validation,
            workers,
        })
    }

    /// Resumes from the folder's last checkpoint: weights, optimiser, schedule and samples.
    ///
    /// # Errors
    /// As [`RunFolder::load`]; [`Error::NoSamples`], [`Error::NoValidation`].
    pub fn resume(
        config: TrainConfig,
        folder: RunFolder,
        sets: (SampleSet, SampleSet),
        device: &Device,
    ) -> Result<Self, Error> {
        Self::resume_among(Box::new(Alone), config, folder, sets, device)
    }

    /// As [`Self::resume`], one of several [`Workers`]: each reads the folder's last checkpoint.
    ///
    /// # Errors
    /// As [`Self::resume`].
    pub fn resume_among(
        workers: Box<dyn Workers>,
        config: TrainConfig,
        folder: RunFolder,
        (train, validation): (SampleSet, SampleSet),
        device: &Device,
    ) -> Result<Self, Error> {
        let config = folder.read_findings()?.complete(config);
        check_precision(&config, device)?;
        check_samples(&config, &train, &validation)?;
        check_camera(&config, [&train, &validation])?;
        let device = device.clone().autodiff();
        let (model, adam, state) = folder.load(CheckpointKind::Last, &config, &device)?;
        let adam = adam.ok_or_else(|| ModelError::NotResumable {
            path: folder.checkpoint_path(CheckpointKind::Last),
            reason: "it has no optimiser state to go on with",
        })?;
        Ok(Self {
            config,
            folder,
            device,
            model,
            adam,
            state,
            train,
            validation,
            workers: Crew::of(workers),
        })
    }

    /// Optimiser steps in the whole run.
    #[must_use]
    pub fn steps(&self) -> usize {
        self.config.steps_of(self.epoch_steps())
    }

    /// Optimiser steps in one pass over the data, of all workers together: over its video, if there is any.
    #[must_use]
    pub fn epoch_steps(&self) -> usize {
        let (samples, batch) = match self.train.samples.len() {
            0 => (self.train.depth.len(), self.config.depth_batch()),
            samples => (samples, self.config.batch),
        };
        let batches = Sampler::new(samples, batch, 0).batches_per_epoch();
        batches.div_ceil(self.config.accumulate * self.workers.count())
    }

    /// Steps done so far.
    #[must_use]
    pub fn step(&self) -> usize {
        self.state.step
    }

    /// The run's folder.
    #[must_use]
    pub fn folder(&self) -> &Path {
        self.folder.path()
    }

    /// The networks as they are now.
    #[must_use]
    pub fn model(&self) -> &Model {
        &self.model
    }

    /// The configuration, with the units that the run found where it leaves them open.
    #[must_use]
    pub fn config(&self) -> &TrainConfig {
        &self.config
    }

    /// Trains to the end, or until `listen` returns [`Control::Stop`]; either way the last checkpoint is written.
    ///
    /// # Errors
    /// [`Error::NotFinite`] naming term and frames; the last good checkpoint stays. [`Error::Data`] if an
    /// image cannot be read, [`Error::Loader`] if the loader has died, [`Error::Model`] if a checkpoint
    /// cannot be written.
    pub fn run(
        &mut self,
        listen: &mut dyn FnMut(TrainEvent) -> Control,
    ) -> Result<TrainSummary, Error> {
        let steps = self.steps();
        let every = match self.config.validate_every {
            0 => self.epoch_steps(),
            every => every,
        };
        let loaders = Loaders::training(&self.config, &self.train, self.state.step, &self.workers);
        self.agree()?;
        listen(TrainEvent::Started {
            from_step: self.state.step,
            steps,
            samples: self.train.samples.len() + self.train.depth.len(),
            validation_samples: self.validation.samples.len() + self.validation.depth.len(),
            mean_displacement_m: self.train.mean_displacement_m(),
        });
        if let Some(message) = learned_focal::warning(&self.config, &self.train) {
            let step = self.state.step;
            listen(TrainEvent::Warning { step, message });
        }
        let start = Instant::now();
        let mut saved = start;
        let mut pace = Pace::new();
        let (mut skipped_in_row, mut stopped) = (0, false);
        let mut ratio = Smoothed::new();
        let mut low_view = Smoothed::new();
        let mut moving = Smoothed::new();
        while self.state.step < steps && !stopped {
            let learned = self.learn(&loaders, self.schedule(steps));
            // One that failed does not leave the others waiting for its gradients.
            let [failed] = self.workers.any([learned.is_err()])?;
            let Learned {
                mut gradients,
                mut losses,
                names,
                images,
                panel,
                monitors,
            } = learned?;
            if failed {
                return Err(Error::Workers {
                    rank: self.workers.rank(),
                    count: self.workers.count(),
                    reason: "another worker has failed".into(),
                });
            }
            self.workers.average(&mut gradients, &mut losses)?;
            for (all, of_step) in [
                (&mut ratio, monitors.ratio),
                (&mut low_view, monitors.valid),
                (&mut moving, monitors.moving),
            ] {
                of_step.into_iter().for_each(|value| all.add(value));
            }
            let learning_rate = self.learning_rate(steps);
            let (outcome, step) = self.adam.begin(
                &gradients,
                learning_rate,
                self.config.clip_norm,
                self.config.weight_decay,
            );
            if let Some(step) = step {
                let Model {
                    depth_net,
                    pose_net,
                    flow_decoder,
                    focal,
                    ..
                } = self.model.clone();
                self.model.depth_net = self.adam.apply(&step, "depth", depth_net, &gradients);
                self.model.pose_net = self.adam.apply(&step, "pose", pose_net, &gradients);
                self.model.flow_decoder =
                    flow_decoder.map(|decoder| self.adam.apply(&step, "flow", decoder, &gradients));
                let step = self.focal_step(step);
                let applied = focal.map(|focal| self.adam.apply(&step, FOCAL, focal, &gradients));
                self.model.focal = match self.config.learned_camera() {
                    Some(camera) => applied.map(|focal| focal.held_to(camera)),
                    None => applied,
                };
            }
            self.state.step += 1;
            let gradient_norm = match outcome {
                StepOutcome::Done { gradient_norm } => {
                    skipped_in_row = 0;
                    gradient_norm
                }
                StepOutcome::Skipped => {
                    self.state.skipped += 1;
                    skipped_in_row += 1;
                    if skipped_in_row == MAX_SKIPPED {
                        return Err(Error::GradientsNotFinite {
                            count: skipped_in_row,
                            step: self.state.step,
                            frames: names.join(", "),
                        });
                    }
                    let message = format!(
                        "step skipped: the gradient is not finite (frames {})",
                        names.join(", ")
                    );
                    listen(TrainEvent::Warning {
                        step: self.state.step,
                        message,
                    });
                    f64::NAN
                }
            };
            pace.step(images * self.workers.count());
            let control = listen(TrainEvent::Step {
                step: self.state.step,
                steps,
                losses,
                learning_rate,
                images_per_second: pace.images_per_second(),
                remaining_s: pace.seconds_per_step() * (steps - self.state.step) as f64,
                scale_ratio: ratio.value(),
                gradient_norm,
            });
            let save = self.workers.leads() && self.checkpoint_is_due(saved.elapsed());
            let [stop, save] = self.workers.any([control == Control::Stop, save])?;
            stopped = stop;
            let due = self.state.step.is_multiple_of(every) || self.state.step == steps;
            if due || stopped || save {
                self.share_statistics()?;
            }
            if due || stopped {
                let shares = [low_view.value(), moving.value()];
                self.report(listen, panel, shares, due)?;
                if stopped || self.state.step == steps {
                    self.report_camera(listen)?;
                }
                saved = Instant::now();
            } else if save {
                self.save_last(listen)?;
                saved = Instant::now();
            }
        }
        Ok(TrainSummary {
            step: self.state.step,
            steps,
            skipped: self.state.skipped,
            best_validation: self.state.best_validation,
            seconds: start.elapsed().as_secs_f64(),
            stopped,
        })
    }

    /// Losses and gradients of this worker's part of a step: the means over its `accumulate` batches.
    fn learn(&self, loaders: &Loaders, schedule: Schedule) -> Result<Learned, Error> {
        let mut learned = Learned::default();
        let scale = 1.0 / self.config.accumulate as f64;
        for _ in 0..self.config.accumulate {
            if let Some(loader) = &loaders.video {
                let batch = self.model.see(next(|| loader.next(&self.device))?);
                learned.images += batch.len() * (1 + batch.offsets.len());
                let (pass, loss) = autocast(self.config.precision, || {
                    let pass = self.model.forward(&batch);
                    let loss = self.model.loss(&pass, &batch, schedule);
                    (pass, loss)
                });
                self.check_finite(&loss.terms, &batch.names)?;
                learned.losses.add(&loss.terms, scale);
                learned.monitors.valid.push(loss.terms.valid_share);
                learned.monitors.moving.push(loss.terms.moving_share);
                learned
                    .monitors
                    .ratio
                    .push(displacement_ratio(&pass, &batch));
                self.add_gradients(&mut learned.gradients, &loss.total, scale);
                // The pass's first target is the batch's first sample.
                let shown = batch.names.first().cloned().unwrap_or_default();
                learned.names.extend(batch.names);
                learned.panel = Some(Shown::View(Box::new((pass, loss, shown))));
            }
            if let Some(loader) = &loaders.depth {
                let batch = next(|| loader.next(&self.device))?;
                learned.images += batch.len();
                let pass = autocast(self.config.precision, || self.model.learn_depth(&batch));
                self.check_finite(&pass.terms, &batch.names)?;
                learned.losses.add(&pass.terms, scale);
                if loaders.video.is_none() {
                    learned.monitors.ratio.push(pass.scale_ratio);
                }
                self.add_gradients(&mut learned.gradients, &pass.total, scale);
                learned.names.extend(batch.names.iter().cloned());
                let panel = learned.panel.take();
                learned.panel = panel.or(Some(Shown::Depth(Box::new((pass, batch)))));
            }
        }
        Ok(learned)
    }

    /// That all workers begin from the same.
    fn agree(&mut self) -> Result<(), Error> {
        if self.workers.count() == 1 {
            return Ok(());
        }
        let mut weights = DefaultHasher::new();
        let focal = self.model.focal.as_ref().map(LearnedFocal::ratio);
        focal.map(f64::to_bits).hash(&mut weights);
        for (prefix, values) in [
            ("depth", collect(&self.model.depth_net)),
            ("pose", collect(&self.model.pose_net)),
        ] {
            prefix.hash(&mut weights);
            for tensor in values.tensors.values() {
                tensor
                    .values
                    .iter()
                    .for_each(|v| v.to_bits().hash(&mut weights));
            }
        }
        let mut samples = DefaultHasher::new();
        (self.train.samples.len(), self.train.depth.len()).hash(&mut samples);
        let mut settings = DefaultHasher::new();
        let config = &self.config;
        let rate = config.learning_rate.to_bits();
        (config.batch, config.accumulate, config.seed, rate).hash(&mut settings);
        (self.state.step, self.steps()).hash(&mut settings);
        // Of another assumed camera the same ln(f/f₀) is another f.
        let camera = config.assumed_camera.map(|camera| {
            let numbers = [camera.hfov_deg, camera.aspect, camera.learning_rate];
            (numbers.map(f64::to_bits), camera.learn)
        });
        camera.hash(&mut settings);
        self.workers
            .hold_the_same([weights.finish(), samples.finish(), settings.finish()])
    }

    /// Running statistics of batch norms are each worker's own between checkpoints; now they become their means.
    fn share_statistics(&mut self) -> Result<(), Error> {
        if self.workers.count() == 1 {
            return Ok(());
        }
        let (depth, pose) = (self.model.depth_net.clone(), self.model.pose_net.clone());
        self.model.depth_net = apply(
            depth,
            &self
                .workers
                .mean_statistics(collect(&self.model.depth_net))?,
        )?;
        self.model.pose_net = apply(
            pose,
            &self
                .workers
                .mean_statistics(collect(&self.model.pose_net))?,
        )?;
        Ok(())
    }

    /// Whether enough time has passed since the last checkpoint to write one between validations.
    fn checkpoint_is_due(&self, passed: Duration) -> bool {
        let minutes = self.config.checkpoint_minutes;
        minutes > 0.0 && passed.as_secs_f64() >= 60.0 * minutes
    }

    /// The schedule at the current step.
    fn schedule(&self, steps: usize) -> Schedule {
        let (step, loss) = (self.state.step, &self.config.loss);
        Schedule {
            speed_weight: speed_weight(
                loss.speed,
                step,
                steps,
                self.epoch_steps(),
                loss.speed_warmup_steps,
            ),
            masks_active: step as f64 >= loss.moving.warmup_share * steps as f64,
        }
    }

    fn learning_rate(&self, steps: usize) -> f64 {
        let done = self.state.step as f64 / steps as f64;
        let factor = match self.config.learning_rate_schedule {
            LearningRateSchedule::Drop if done < self.config.learning_rate_drop => 1.0,
            LearningRateSchedule::Drop => 0.1,
            LearningRateSchedule::Cosine => {
                let end = COSINE_END;
                end + (1.0 - end) * 0.5 * (1.0 + (std::f64::consts::PI * done).cos())
            }
        };
        let warmup = self.config.learning_rate_warmup_steps.max(1) as f64;
        let rise = ((self.state.step + 1) as f64 / warmup).min(1.0);
        self.config.learning_rate * rise * factor
    }

    /// A step of the optimiser at the focal length's own step size, as far into its schedule as the networks'.
    fn focal_step(&self, step: AdamStep) -> AdamStep {
        let own = self.config.learned_camera();
        let share = f64::from(step.learning_rate) / self.config.learning_rate;
        AdamStep {
            learning_rate: own.map_or(0.0, |camera| share * camera.learning_rate) as f32,
            weight_decay: 0.0,
            ..step
        }
    }

    /// # Errors
    /// [`Error::NotFinite`] naming the first term that is not finite.
    fn check_finite(&self, terms: &LossTerms, names: &[String]) -> Result<(), Error> {
        match terms.not_finite() {
            None => Ok(()),
            Some((term, value)) => Err(Error::NotFinite {
                step: self.state.step + 1,
                term,
                value,
                frames: names.join(", "),
            }),
        }
    }

    /// Adds a loss' gradients, `scale` times.
    fn add_gradients(&self, gradients: &mut NamedGradients, total: &Tensor<1>, scale: f64) {
        let (mut raw, scale) = (total.backward(), scale as f32);
        gradients.add("depth", &self.model.depth_net, &mut raw, scale);
        gradients.add("pose", &self.model.pose_net, &mut raw, scale);
        if let Some(decoder) = &self.model.flow_decoder {
            gradients.add("flow", decoder, &mut raw, scale);
        }
        if let Some(focal) = &self.model.focal {
            gradients.add(FOCAL, focal, &mut raw, scale);
        }
    }

    /// Panel, validation and checkpoints.
    fn report(
        &mut self,
        listen: &mut dyn FnMut(TrainEvent) -> Control,
        shown: Option<Shown>,
        [valid_share, moving_share]: [f64; 2],
        validate: bool,
    ) -> Result<(), Error> {
        let step = self.state.step;
        if let Some(shown) = shown {
            let panel = Box::new(shown.panel());
            listen(TrainEvent::Panel { step, panel });
        }
        // Without video both are NaN, and are no reason to warn.
        if valid_share < MIN_VALID_SHARE {
            let message = format!(
                "only {:.0} % of the pixels are in view of the other frame: depth or motion has come apart",
                100.0 * valid_share
            );
            listen(TrainEvent::Warning { step, message });
        }
        if moving_share > MAX_MOVING_SHARE {
            let message = format!(
                "{:.0} % of the pixels are taken to move by themselves: the flow explains more than depth and motion do; \
                 a longer warm-up (`loss.moving.warmup_share`) lets depth learn first",
                100.0 * moving_share
            );
            listen(TrainEvent::Warning { step, message });
        }
        if !self.workers.leads() {
            return Ok(());
        }
        if validate && !self.validation.is_empty() {
            let (losses, scale_ratio) =
                validation_loss(&self.model, &self.config, &self.validation, &self.device)?;
            let selection = selection(&self.config, &losses);
            let best =
                selection.is_finite() && self.state.best_validation.is_none_or(|b| selection < b);
            if best {
                self.state.best_validation = Some(selection);
            }
            listen(TrainEvent::Validated {
                step,
                losses,
                selection,
                scale_ratio,
                best,
            });
            if best {
                let path =
                    self.folder
                        .save(CheckpointKind::Best, &self.model, None, &self.state)?;
                listen(TrainEvent::Saved { step, path });
            }
        }
        self.save_last(listen)
    }

    /// Says which camera was learned and how well, and keeps it among what the run found out.
    fn report_camera(&self, listen: &mut dyn FnMut(TrainEvent) -> Control) -> Result<(), Error> {
        let Some(focal) = self.model.focal.as_ref().filter(|_| self.workers.leads()) else {
            return Ok(());
        };
        let size = self.train.camera().map(|k| (k.width, k.height));
        let camera = size.and_then(|size| self.config.camera_learned(focal.ratio(), size));
        let Some(camera) = camera else {
            return Ok(());
        };
        let spread = focal_spread(&self.model, &self.config, &self.train, &self.device)?;
        let step = self.state.step;
        let learned = LearnedCamera {
            focal_px: [camera.fx, camera.fy],
            sigma_px: spread.map(|sigma| [sigma * camera.fx, sigma * camera.fy]),
            step,
        };
        let mut findings = self.folder.read_findings()?;
        findings.learn_camera(&self.config, camera);
        findings.learned_camera = Some(learned);
        self.folder
            .write_config(&self.folder.read_settings()?, &findings)?;
        listen(TrainEvent::Camera { camera, learned });
        if !learned.is_told() {
            let message = CAMERA_NOT_TOLD.to_owned();
            listen(TrainEvent::Warning { step, message });
        }
        Ok(())
    }

    /// Writes the checkpoint to resume from.
    fn save_last(&self, listen: &mut dyn FnMut(TrainEvent) -> Control) -> Result<(), Error> {
        if !self.workers.leads() {
            return Ok(());
        }
        let step = self.state.step;
        let path = self.folder.save(
            CheckpointKind::Last,
            &self.model,
            Some(&self.adam),
            &self.state,
        )?;
        listen(TrainEvent::Saved { step, path });
        Ok(())
    }
}

/// The loaders of the training data.
struct Loaders {
    video: Option<BatchLoader>,
    depth: Option<DepthLoader>,
}

impl Loaders {
    /// From a step on, this worker's batches: of K workers every K-th.
    fn training(config: &TrainConfig, set: &SampleSet, step: usize, workers: &Crew) -> Self {
        let (rank, count) = (workers.rank(), workers.count());
        let first = step * config.accumulate * count + rank;
        let numbers = move || (first..).step_by(count);
        let video = !set.samples.is_empty();
        Self {
            video: video.then(|| BatchLoader::training_batches(config, set.clone(), numbers())),
            depth: (!set.depth.is_empty())
                .then(|| DepthLoader::training_batches(config, set.depth.clone(), numbers())),
        }
    }
}

/// What a worker has learned from its part of a step.
#[derive(Default)]
struct Learned {
    gradients: NamedGradients,
    losses: LossTerms,
    /// Drives and frames.
    names: Vec<String>,
    images: usize,
    panel: Option<Shown>,
    monitors: Monitors,
}

/// Figures of each batch that are smoothed over the steps.
#[derive(Default)]
struct Monitors {
    ratio: Vec<f64>,
    valid: Vec<f64>,
    moving: Vec<f64>,
}

/// What a panel shows.
enum Shown {
    View(Box<(ForwardPass, BatchLoss, String)>),
    Depth(Box<(DepthPass, DepthBatch)>),
}

impl Shown {
    fn panel(self) -> SamplePanel {
        match self {
            Self::View(parts) => {
                let (pass, loss, name) = *parts;
                SamplePanel::first(&pass, &loss, name)
            }
            Self::Depth(parts) => SamplePanel::of_depth(&parts.0, &parts.1),
        }
    }
}

/// The next batch of a loader that never ends.
fn next<T>(batch: impl FnOnce() -> Option<Result<T, Error>>) -> Result<T, Error> {
    batch().unwrap_or_else(|| {
        Err(Error::Loader {
            reason: "it has no further batch".into(),
        })
    })
}

/// Metres per unit of PoseNet's translation; 1 without video, where it does not matter.
fn first_unit(config: &TrainConfig, set: &SampleSet) -> f64 {
    if set.samples.is_empty() {
        1.0
    } else {
        config.first_unit(set.mean_displacement_m())
    }
}

/// What the training samples say: their cameras, and the units that the configuration leaves open.
fn findings(config: &TrainConfig, train: &SampleSet) -> TrainFindings {
    let unit = |set: f64, samples: &SampleSet| (set == 0.0).then(|| first_unit(config, samples));
    let sets = config.data.sets.iter().enumerate().map(|(i, set)| {
        let own = train.of_set(i);
        SetFindings {
            name: set.name.clone(),
            metres_per_unit: unit(set.metres_per_unit, &own),
            camera: own.camera(),
        }
    });
    TrainFindings {
        metres_per_unit: unit(config.pose_net.metres_per_unit, train),
        camera: train.camera(),
        learned_camera: None,
        sets: sets.collect(),
    }
}

/// # Errors
fn check_precision(config: &TrainConfig, device: &Device) -> Result<(), Error> {
    if supports(device, config.precision) {
        return Ok(());
    }
    Err(Error::Precision {
        found: match config.precision {
            Precision::F32 => "f32",
            Precision::Bf16 => "bf16",
        },
    })
}

/// # Errors
/// [`Error::NoSamples`] without anything to train on, [`Error::NoValidation`] if samples should be held out and
/// none are.
fn check_samples(
    config: &TrainConfig,
    train: &SampleSet,
    validation: &SampleSet,
) -> Result<(), Error> {
    if train.is_empty() {
        return Err(no_samples("the training data"));
    }
    if validation.is_empty() && config.validation_share > 0.0 {
        return Err(Error::NoValidation);
    }
    Ok(())
}

fn no_samples(data: &str) -> Error {
    Error::NoSamples {
        data: data.into(),
        reason: "it is empty".into(),
    }
}

/// The mean loss over the held-out samples, with λ_v at its full weight and without the flow, which exists
/// only in training; and the ratio of measured to predicted displacement.
///
/// # Errors
/// [`Error::NoSamples`] without samples, [`Error::Data`] if an image cannot be read, [`Error::Loader`] if the
/// loader has died.
pub fn validation_loss(
    model: &Model,
    config: &TrainConfig,
    samples: &SampleSet,
    device: &Device,
) -> Result<(LossTerms, f64), Error> {
    if samples.is_empty() {
        return Err(no_samples("the held-out data"));
    }
    let (model, device) = (model.valid(device), device.clone().inner());
    let mut terms = LossTerms::default();
    let mut scale_ratio = None;
    if !samples.samples.is_empty() {
        let mut mean = Mean::default();
        let loader = BatchLoader::validation(config, samples.clone());
        let schedule = Schedule {
            speed_weight: config.loss.speed,
            masks_active: false,
        };
        while let Some(batch) = loader.next(&device) {
            let batch = model.see(batch?);
            let pass = model.forward(&batch);
            let terms = model.loss(&pass, &batch, schedule).terms;
            mean.add(batch.len(), &terms, displacement_ratio(&pass, &batch));
        }
        scale_ratio = Some(mean.ratio / mean.count);
        terms.add(&mean.terms, 1.0 / mean.count);
    }
    if !samples.depth.is_empty() {
        let mut mean = Mean::default();
        let loader = DepthLoader::validation(config, samples.depth.clone());
        while let Some(batch) = loader.next(&device) {
            let batch = batch?;
            let pass = model.learn_depth(&batch);
            mean.add(batch.len(), &pass.terms, pass.scale_ratio.ln());
        }
        scale_ratio.get_or_insert((mean.ratio / mean.count).exp());
        terms.add(&mean.terms, 1.0 / mean.count);
    }
    Ok((terms, scale_ratio.unwrap_or(f64::NAN)))
}

/// Sums over the batches of a validation.
#[derive(Default)]
struct Mean {
    terms: LossTerms,
    ratio: f64,
    count: f64,
}

impl Mean {
    fn add(&mut self, images: usize, terms: &LossTerms, ratio: f64) {
        let n = images as f64;
        self.count += n;
        self.ratio += n * ratio;
        self.terms.add(terms, n);
    }
}

/// An exponential mean that starts at its first value.
struct Smoothed(Option<f64>);

impl Smoothed {
    fn new() -> Self {
        Self(None)
    }

    fn add(&mut self, value: f64) {
        let old = self.0.unwrap_or(value);
        self.0 = Some(old + (value - old) / SMOOTHING);
    }

    fn value(&self) -> f64 {
        self.0.unwrap_or(f64::NAN)
    }
}

/// Time a step takes.
struct Pace {
    last: Instant,
    seconds: Smoothed,
    images: f64,
}

impl Pace {
    fn new() -> Self {
        Self {
            last: Instant::now(),
            seconds: Smoothed::new(),
            images: 0.0,
        }
    }

    fn step(&mut self, images: usize) {
        self.seconds.add(self.last.elapsed().as_secs_f64());
        self.last = Instant::now();
        self.images = images as f64;
    }

    fn seconds_per_step(&self) -> f64 {
        self.seconds.value()
    }

    fn images_per_second(&self) -> f64 {
        self.images / self.seconds_per_step()
    }
}
