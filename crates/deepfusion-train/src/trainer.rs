use crate::losses::speed_weight;
use crate::model::displacement_ratio;
use crate::selection::selection;
use crate::{
    Adam, BatchLoader, BatchLoss, Checkpoint, CheckpointKind, Control, Error, ForwardPass,
    LossTerms, Model, NamedGradients, RunFolder, SamplePanel, SampleSet, Sampler, Schedule,
    SnippetBatch, StepOutcome, TrainConfig, TrainEvent,
};
use burn::tensor::Device;
use std::path::Path;
use std::time::{Duration, Instant};

/// Skipped steps in a row after which training gives up.
const MAX_SKIPPED: usize = 20;
/// Steps that the pace and the scale ratio are averaged over.
const SMOOTHING: f64 = 20.0;
/// Below this share of pixels in view the geometry has come apart (SPEC 2).
const MIN_VALID_SHARE: f64 = 0.2;
/// Above this share of moving pixels the masks take away what depth should learn from (SPEC 2).
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
    /// The lowest value that `best` is chosen by.
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
    /// A new run in `folder`. The configuration's open values (camera, metres per unit of pose) are
    /// taken from the data and stored with it. `init` changes the networks before the first step.
    ///
    /// # Errors
    /// [`Error::Config`], [`Error::NoSamples`], [`Error::NoValidation`], [`Error::Network`], [`Error::Io`].
    pub fn create(
        mut config: TrainConfig,
        folder: RunFolder,
        (train, validation): (SampleSet, SampleSet),
        device: &Device,
        init: impl FnOnce(Model) -> Result<Model, Error>,
    ) -> Result<Self, Error> {
        config.validate()?;
        config.make_absolute();
        check_samples(&config, &train, &validation)?;
        if config.pose_net.metres_per_unit == 0.0 {
            config.pose_net.metres_per_unit = config.first_unit(train.mean_displacement_m());
        }
        config.camera = train.camera();
        for i in 0..config.data.sets.len() {
            let own = train.of_set(i);
            let unit = config.first_unit(own.mean_displacement_m());
            let set = &mut config.data.sets[i];
            if set.metres_per_unit == 0.0 {
                set.metres_per_unit = unit;
            }
            set.trained_with = own.camera();
        }
        let device = device.clone().autodiff();
        let model = init(Model::new(&config, &device)?)?;
        folder.write_config(&config)?;
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

    /// Goes on where the folder's last checkpoint stood: weights, optimiser, schedule and samples.
    ///
    /// # Errors
    /// As [`RunFolder::load`]; [`Error::NoSamples`], [`Error::NoValidation`].
    pub fn resume(
        config: TrainConfig,
        folder: RunFolder,
        (train, validation): (SampleSet, SampleSet),
        device: &Device,
    ) -> Result<Self, Error> {
        check_samples(&config, &train, &validation)?;
        let device = device.clone().autodiff();
        let (model, adam, state) = folder.load(CheckpointKind::Last, &config, &device)?;
        let adam = adam.ok_or_else(|| Error::Checkpoint {
            path: folder.checkpoint_path(CheckpointKind::Last),
            reason: "it has no optimiser state to go on with".into(),
            remedy: "start a new run from these weights with --init".into(),
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

    /// Steps of the optimiser in the whole run.
    #[must_use]
    pub fn steps(&self) -> usize {
        self.config.steps_of(self.epoch_steps())
    }

    /// Steps of the optimiser in a pass over the data.
    #[must_use]
    pub fn epoch_steps(&self) -> usize {
        let sampler = Sampler::new(self.train.samples.len(), self.config.batch, 0);
        sampler.batches_per_epoch().div_ceil(self.config.accumulate)
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

    /// The configuration, with what was taken from the data.
    #[must_use]
    pub fn config(&self) -> &TrainConfig {
        &self.config
    }

    /// Trains to the end, or until `listen` says stop; either way the last checkpoint is written.
    ///
    /// # Errors
    /// [`Error::NotFinite`] naming term and frames: the last good checkpoint stays. [`Error::Data`]
    /// for an image that cannot be read, [`Error::Loader`] where the loader has died, [`Error::Network`] for a
    /// checkpoint that cannot be written.
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
        let loader = BatchLoader::training(
            &self.config,
            self.train.clone(),
            self.state.step * accumulate,
        );
        listen(TrainEvent::Started {
            from_step: self.state.step,
            steps,
            samples: self.train.samples.len(),
            validation_samples: self.validation.samples.len(),
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
            let mut last: Option<(ForwardPass, BatchLoss, String)> = None;
            for _ in 0..accumulate {
                let batch = next_batch(&loader, &self.device)?;
                images += batch.len() * (1 + batch.offsets.len());
                let pass = self.model.forward(&batch);
                let loss = self.model.loss(&pass, &batch, schedule);
                losses.add(&loss.terms, 1.0 / accumulate as f64);
                if let Some((term, value)) = loss.terms.not_finite() {
                    return Err(Error::NotFinite {
                        step: self.state.step + 1,
                        term,
                        value,
                        frames: batch.names.join(", "),
                    });
                }
                ratio.add(displacement_ratio(&pass, &batch));
                let mut raw = loss.total.backward();
                let scale = 1.0 / accumulate as f32;
                gradients.add("depth", &self.model.depth_net, &mut raw, scale);
                gradients.add("pose", &self.model.pose_net, &mut raw, scale);
                if let Some(decoder) = &self.model.flow_decoder {
                    gradients.add("flow", decoder, &mut raw, scale);
                }
                // The pass's first target is the batch's first sample.
                let shown = batch.names.first().cloned().unwrap_or_default();
                names.extend(batch.names);
                last = Some((pass, loss, shown));
            }
            let learning_rate = self.learning_rate(steps);
            let (outcome, step) = self
                .adam
                .begin(&gradients, learning_rate, self.config.clip_norm);
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
            low_view.add(losses.valid_share);
            moving.add(losses.moving_share);
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
                self.report(listen, last, shares, due)?;
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

    /// Whether so much time has passed since a checkpoint that one is written between validations, too.
    fn checkpoint_is_due(&self, passed: Duration) -> bool {
        let minutes = self.config.checkpoint_minutes;
        minutes > 0.0 && passed.as_secs_f64() >= 60.0 * minutes
    }

    /// What of the loss depends on the step.
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
        let drop = self.config.learning_rate_drop * steps as f64;
        let factor = if (self.state.step as f64) < drop {
            1.0
        } else {
            0.1
        };
        let warmup = self.config.learning_rate_warmup_steps.max(1) as f64;
        let rise = ((self.state.step + 1) as f64 / warmup).min(1.0);
        self.config.learning_rate * rise * factor
    }

    /// Panel, validation and checkpoints.
    fn report(
        &mut self,
        listen: &mut dyn FnMut(TrainEvent) -> Control,
        last: Option<(ForwardPass, BatchLoss, String)>,
        [valid_share, moving_share]: [f64; 2],
        validate: bool,
    ) -> Result<(), Error> {
        let step = self.state.step;
        if let Some((pass, loss, name)) = last {
            let panel = Box::new(SamplePanel::first(&pass, &loss, name));
            listen(TrainEvent::Panel { step, panel });
        }
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
        if validate && !self.validation.samples.is_empty() {
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

    /// Writes the checkpoint to go on from.
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

fn next_batch(loader: &BatchLoader, device: &Device) -> Result<SnippetBatch, Error> {
    loader.next(device).unwrap_or_else(|| {
        Err(Error::Loader {
            reason: "it has no further batch".into(),
        })
    })
}

/// # Errors
/// [`Error::NoSamples`] without anything to train on, [`Error::NoValidation`] where samples should be held out and
/// none are.
fn check_samples(
    config: &TrainConfig,
    train: &SampleSet,
    validation: &SampleSet,
) -> Result<(), Error> {
    if train.samples.is_empty() {
        return Err(no_samples("the training data"));
    }
    if validation.samples.is_empty() && config.validation_share > 0.0 {
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

/// The mean loss over the held-out samples, with λ_v at its full weight and without the flow, which training
/// alone has; and the ratio of measured to predicted displacement.
///
/// # Errors
/// [`Error::NoSamples`] without samples, [`Error::Data`] for an image that cannot be read, [`Error::Loader`] where
/// the loader has died.
pub fn validation_loss(
    model: &Model,
    config: &TrainConfig,
    samples: &SampleSet,
    device: &Device,
) -> Result<(LossTerms, f64), Error> {
    if samples.samples.is_empty() {
        return Err(no_samples("the held-out data"));
    }
    let (model, device) = (model.valid(device), device.clone().inner());
    let loader = BatchLoader::validation(config, samples.clone());
    let mut sum = LossTerms::default();
    let (mut count, mut ratio) = (0.0, 0.0);
    while let Some(batch) = loader.next(&device) {
        let batch = batch?;
        let pass = model.forward(&batch);
        let schedule = Schedule {
            speed_weight: config.loss.speed,
            masks_active: false,
        };
        let terms = model.loss(&pass, &batch, schedule).terms;
        let n = batch.len() as f64;
        count += n;
        ratio += n * displacement_ratio(&pass, &batch);
        sum.add(&terms, n);
    }
    let mut terms = LossTerms::default();
    terms.add(&sum, 1.0 / count);
    Ok((terms, ratio / count))
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
