use crate::losses::speed_weight;
use crate::model::displacement_ratio;
use crate::selection::selection;
use crate::{
    Adam, BatchLoader, BatchLoss, Checkpoint, CheckpointKind, Checkpoints, Control, DepthBatch,
    DepthLoader, DepthPass, Error, ForwardPass, LearningRateSchedule, LossTerms, Model,
    NamedGradients, RunFolder, SamplePanel, SampleSet, Sampler, Schedule, StepOutcome, TrainConfig,
    TrainEvent,
};
use burn::tensor::{Device, Tensor};
use deepfusion_model::{Error as ModelError, SetFindings, TrainFindings};
use deepfusion_nn::ops::{Precision, autocast, supports};
use std::path::Path;
use std::time::{Duration, Instant};

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
        mut config: TrainConfig,
        folder: RunFolder,
        (train, validation): (SampleSet, SampleSet),
        device: &Device,
        init: impl FnOnce(Model) -> Result<Model, Error>,
    ) -> Result<Self, Error> {
        config.validate()?;
        check_precision(&config, device)?;
        config.make_absolute();
        check_samples(&config, &train, &validation)?;
        let settings = config;
        let findings = findings(&settings, &train);
        let config = findings.complete(settings.clone());
        let device = device.clone().autodiff();
        let model = init(Model::new(&config, &device)?)?;
        folder.write_config(&settings, &findings)?;
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
            },
            train,
            validation,
        })
    }

    /// Resumes from the folder's last checkpoint: weights, optimiser, schedule and samples.
    ///
    /// # Errors
    /// As [`RunFolder::load`]; [`Error::NoSamples`], [`Error::NoValidation`].
    pub fn resume(
        config: TrainConfig,
        folder: RunFolder,
        (train, validation): (SampleSet, SampleSet),
        device: &Device,
    ) -> Result<Self, Error> {
        let config = folder.read_findings()?.complete(config);
        check_precision(&config, device)?;
        check_samples(&config, &train, &validation)?;
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
        })
    }

    /// Optimiser steps in the whole run.
    #[must_use]
    pub fn steps(&self) -> usize {
        self.config.steps_of(self.epoch_steps())
    }

    /// Optimiser steps in one pass over the data: over its video, if there is any.
    #[must_use]
    pub fn epoch_steps(&self) -> usize {
        let (samples, batch) = match self.train.samples.len() {
            0 => (self.train.depth.len(), self.config.depth_batch()),
            samples => (samples, self.config.batch),
        };
        let batches = Sampler::new(samples, batch, 0).batches_per_epoch();
        batches.div_ceil(self.config.accumulate)
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
        let accumulate = self.config.accumulate;
        let loaders = Loaders::training(&self.config, &self.train, self.state.step * accumulate);
        listen(TrainEvent::Started {
            from_step: self.state.step,
            steps,
            samples: self.train.samples.len() + self.train.depth.len(),
            validation_samples: self.validation.samples.len() + self.validation.depth.len(),
            mean_displacement_m: self.train.mean_displacement_m(),
        });
        let start = Instant::now();
        let mut saved = start;
        let mut pace = Pace::new();
        let (mut skipped_in_row, mut stopped) = (0, false);
        let mut ratio = Smoothed::new();
        let mut low_view = Smoothed::new();
        let mut moving = Smoothed::new();
        while self.state.step < steps && !stopped {
            let mut gradients = NamedGradients::default();
            let (mut losses, mut names) = (LossTerms::default(), Vec::new());
            let schedule = self.schedule(steps);
            let mut images = 0;
            let mut panel = None;
            let scale = 1.0 / accumulate as f64;
            for _ in 0..accumulate {
                if let Some(loader) = &loaders.video {
                    let batch = next(|| loader.next(&self.device))?;
                    images += batch.len() * (1 + batch.offsets.len());
                    let (pass, loss) = autocast(self.config.precision, || {
                        let pass = self.model.forward(&batch);
                        let loss = self.model.loss(&pass, &batch, schedule);
                        (pass, loss)
                    });
                    self.check_finite(&loss.terms, &batch.names)?;
                    losses.add(&loss.terms, scale);
                    low_view.add(loss.terms.valid_share);
                    moving.add(loss.terms.moving_share);
                    ratio.add(displacement_ratio(&pass, &batch));
                    self.add_gradients(&mut gradients, &loss.total, scale);
                    // The pass's first target is the batch's first sample.
                    let shown = batch.names.first().cloned().unwrap_or_default();
                    names.extend(batch.names);
                    panel = Some(Shown::View(Box::new((pass, loss, shown))));
                }
                if let Some(loader) = &loaders.depth {
                    let batch = next(|| loader.next(&self.device))?;
                    images += batch.len();
                    let pass = autocast(self.config.precision, || self.model.learn_depth(&batch));
                    self.check_finite(&pass.terms, &batch.names)?;
                    losses.add(&pass.terms, scale);
                    if loaders.video.is_none() {
                        ratio.add(pass.scale_ratio);
                    }
                    self.add_gradients(&mut gradients, &pass.total, scale);
                    names.extend(batch.names.iter().cloned());
                    panel = panel.or(Some(Shown::Depth(Box::new((pass, batch)))));
                }
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
                    ..
                } = self.model.clone();
                self.model.depth_net = self.adam.apply(&step, "depth", depth_net, &gradients);
                self.model.pose_net = self.adam.apply(&step, "pose", pose_net, &gradients);
                self.model.flow_decoder =
                    flow_decoder.map(|decoder| self.adam.apply(&step, "flow", decoder, &gradients));
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
            pace.step(images);
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
            stopped = control == Control::Stop;
            let due = self.state.step.is_multiple_of(every) || self.state.step == steps;
            if due || stopped {
                let shares = [low_view.value(), moving.value()];
                self.report(listen, panel, shares, due)?;
                saved = Instant::now();
            } else if self.checkpoint_is_due(saved.elapsed()) {
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

    /// Writes the checkpoint to resume from.
    fn save_last(&self, listen: &mut dyn FnMut(TrainEvent) -> Control) -> Result<(), Error> {
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
    fn training(config: &TrainConfig, set: &SampleSet, first: usize) -> Self {
        let video = !set.samples.is_empty();
        Self {
            video: video.then(|| BatchLoader::training(config, set.clone(), first)),
            depth: (!set.depth.is_empty())
                .then(|| DepthLoader::training(config, set.depth.clone(), first)),
        }
    }
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
            let batch = batch?;
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
