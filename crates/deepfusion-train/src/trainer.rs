//! A training run, from its first step or its last checkpoint to its end.

mod among;
mod figures;
mod pace;
mod report;
mod schedule;
mod start;
mod step;
mod step_reports;
mod validation;

pub use validation::validation_loss;

use crate::freeze::freeze;
use crate::learned_focal::{self, check_camera};
use crate::stereo;
use crate::workers::{SingleWorker, WorkerGroup, Workers};
use crate::{
    Adam, Checkpoint, CheckpointKind, Checkpoints, Control, Error, Model, RunFolder, SampleSet,
    Sampler, TrainConfig, TrainEvent, WorkersProblem,
};
use burn::tensor::Device;
use deepfusion_model::{CheckpointLacks, Error as ModelError};
use deepfusion_nn::ops::is_cpu;
use start::{check_precision, check_samples, findings, focal_warning, turns_warning};
use std::path::Path;
use std::time::Instant;
use step::Loaders;
use step_reports::{ReadInterval, StepReports};

/// Skipped steps in a row after which training gives up.
const MAX_SKIPPED: usize = 20;

/// A training run.
pub struct Trainer {
    config: TrainConfig,
    folder: RunFolder,
    device: Device,
    /// `None` only while the optimiser owns it.
    model: Option<Model>,
    adam: Adam,
    state: Checkpoint,
    train: SampleSet,
    validation: SampleSet,
    workers: WorkerGroup,
    /// Whether numbers stay on the device at first: reading each of them would make a GPU wait. On the processor reading is free, and a
    /// loss that is not finite is found before its gradients are computed.
    reads_late: bool,
    read_interval: ReadInterval,
}

/// How a run ended.
#[derive(Debug, Clone, PartialEq)]
pub struct TrainSummary {
    /// Steps done.
    pub step: usize,
    /// Steps of the whole run.
    pub steps: usize,
    /// Steps skipped because the gradient was not finite.
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
    /// Starts a run in a folder. `init` gets networks with random weights and returns the networks to start from.
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
        Self::create_among(Box::new(SingleWorker), config, folder, sets, device, init)
    }

    /// As [`Self::create`], as one of several [`Workers`]. `config.batch` and `config.accumulate` apply to each worker. Only worker 0
    /// writes into the folder.
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
        let workers = WorkerGroup::of(workers);
        config.validate()?;
        config.validate_video_sizes()?;
        check_precision(&config, device)?;
        config.make_absolute();
        check_samples(&config, &train, &validation)?;
        check_camera(&config, [&train, &validation])?;
        let settings = config;
        let findings = findings(&settings, &train);
        let config = findings.complete_for_training(settings.clone());
        let reads_late = !is_cpu(device);
        let device = device.clone().autodiff();
        let model = freeze(init(Model::new(&config, &device)?)?, &config, &train)?;
        if workers.leads() {
            folder.write_config(&settings, &findings)?;
        }
        Ok(Self {
            config,
            folder,
            device,
            model: Some(model),
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
            reads_late,
            read_interval: ReadInterval::USUAL,
        })
    }

    /// Resumes from the folder's last checkpoint: weights, optimiser, position in the schedule and in the samples.
    ///
    /// # Errors
    /// [`ModelError::NoCheckpoint`]; as [`RunFolder::load`]; [`Error::NoSamples`], [`Error::NoValidation`].
    pub fn resume(
        config: TrainConfig,
        folder: RunFolder,
        sets: (SampleSet, SampleSet),
        device: &Device,
    ) -> Result<Self, Error> {
        Self::resume_among(Box::new(SingleWorker), config, folder, sets, device)
    }

    /// As [`Self::resume`], as one of several [`Workers`]. Each reads the folder's last checkpoint.
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
        folder.require_checkpoint(CheckpointKind::Last)?;
        let config = folder.read_findings()?.complete_for_training(config);
        check_precision(&config, device)?;
        check_samples(&config, &train, &validation)?;
        check_camera(&config, [&train, &validation])?;
        let reads_late = !is_cpu(device);
        let device = device.clone().autodiff();
        let (model, adam, state) = folder.load(CheckpointKind::Last, &config, &device)?;
        let model = freeze(model, &config, &train)?;
        let adam = adam.ok_or_else(|| ModelError::NotResumable {
            path: folder.checkpoint_path(CheckpointKind::Last),
            reason: CheckpointLacks::OptimiserState,
        })?;
        Ok(Self {
            config,
            folder,
            device,
            model: Some(model),
            adam,
            state,
            train,
            validation,
            workers: WorkerGroup::of(workers),
            reads_late,
            read_interval: ReadInterval::USUAL,
        })
    }

    /// Optimiser steps in the whole run.
    #[must_use]
    pub fn steps(&self) -> usize {
        self.config.steps_of(self.epoch_steps())
    }

    /// Optimiser steps in one pass of all workers over the data: over its video, if there is any.
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

    /// The networks in their current state.
    #[must_use]
    #[expect(clippy::expect_used, reason = "a step gives back what it took")]
    pub fn model(&self) -> &Model {
        self.model.as_ref().expect("no step is being made")
    }

    /// The training samples.
    #[must_use]
    pub fn samples(&self) -> &SampleSet {
        &self.train
    }

    /// The configuration, completed with the values that the run found in the data.
    #[must_use]
    pub fn config(&self) -> &TrainConfig {
        &self.config
    }

    /// Trains to the end, or until `listen` returns [`Control::Stop`]. Writes the last checkpoint in either case.
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
            known_depth: self.train.depth.recorded(),
            simulated: self.train.depth.len() - self.train.depth.recorded(),
            validation_samples: self.validation.samples.len() + self.validation.depth.len(),
            mean_displacement_m: self.train.mean_displacement_m(),
        });
        let warnings = [
            learned_focal::warning(&self.config, &self.train),
            turns_warning(&self.config, &self.train),
            focal_warning(&self.config, &self.train),
            stereo::warning(&self.config, &self.train),
        ];
        for warning in warnings.into_iter().flatten() {
            let step = self.state.step;
            listen(TrainEvent::Warning { step, warning });
        }
        let start = Instant::now();
        let mut saved = start;
        let mut reports = StepReports::new(steps);
        let mut stopped = false;
        while self.state.step < steps && !stopped {
            let learned = self.learn(&loaders, self.schedule(steps));
            // A worker that failed must not leave the others waiting for its gradients.
            let [failed] = self.workers.any([learned.is_err()])?;
            if learned.is_err() {
                // Earlier steps are reported before the error.
                self.report_waiting(&mut reports, listen)?;
            }
            let mut learned = learned?;
            if failed {
                return Err(self.another_failed());
            }
            let losses = &mut learned.figures.losses;
            self.workers.average(&mut learned.gradients, losses)?;
            let panel = learned.panel.take();
            let control = self.make_step(learned, &mut reports, listen)?;
            let save = self.workers.leads() && self.checkpoint_is_due(saved.elapsed());
            let [stop, save] = self.workers.any([control == Control::Stop, save])?;
            stopped = stop;
            let due = self.state.step.is_multiple_of(every) || self.state.step == steps;
            if due || stopped || save {
                stopped |= self.report_waiting(&mut reports, listen)? == Control::Stop;
                self.share_statistics()?;
                let reported = if due || stopped {
                    self.report(listen, panel, reports.shares(), due)
                        .and_then(|()| {
                            if stopped || self.state.step == steps {
                                self.report_camera(listen)
                            } else {
                                Ok(())
                            }
                        })
                } else {
                    self.save_last(listen)
                };
                // Only the first worker validates and writes. If that fails, the others must not wait for its next gradients.
                let [failed] = self.workers.any([reported.is_err()])?;
                reported?;
                if failed {
                    return Err(self.another_failed());
                }
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

    fn another_failed(&self) -> Error {
        Error::Workers {
            rank: self.workers.rank(),
            count: self.workers.count(),
            reason: WorkersProblem::AnotherFailed,
        }
    }
}

#[cfg(test)]
mod tests;
