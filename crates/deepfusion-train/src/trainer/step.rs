//! What one worker learns from its part of a step: losses, and their gradients by name; and the step of the optimiser.

use super::Trainer;
use crate::model::displacement_ratio;
use crate::workers::WorkerGroup;
use crate::{
    Adam, BatchLoader, BatchLoss, DepthBatch, DepthLoader, DepthPass, Error, ForwardPass,
    LoaderProblem, LossTerms, Model, NamedGradients, SamplePanel, SampleSet, Schedule, TrainConfig,
};
use burn::tensor::Tensor;
use deepfusion_kernels::AdamStep;
use deepfusion_nn::ops::autocast;

/// The name of the focal length among parameters and moments.
const FOCAL: &str = "focal";

impl Trainer {
    /// Losses and gradients of this worker's part of a step: the means over its `accumulate` batches.
    pub(super) fn learn(&self, loaders: &Loaders, schedule: Schedule) -> Result<WorkerStep, Error> {
        let mut learned = WorkerStep::default();
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
                self.model
                    .add_gradients(&loss.total, scale as f32, &mut learned.gradients);
                // The pass's first target is the batch's first sample.
                let shown = batch.names.first().cloned().unwrap_or_default();
                learned.names.extend(batch.names);
                learned.panel = Some(PanelInput::View(Box::new((pass, loss, shown))));
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
                self.model
                    .add_gradients(&pass.total, scale as f32, &mut learned.gradients);
                learned.names.extend(batch.names.iter().cloned());
                let panel = learned.panel.take();
                learned.panel = panel.or(Some(PanelInput::Depth(Box::new((pass, batch)))));
            }
        }
        Ok(learned)
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

    /// A step of the optimiser on everything that learns.
    pub(super) fn apply(&mut self, step: AdamStep, gradients: &NamedGradients) {
        let model = self.model.clone();
        let focal = model.focal.clone();
        self.model = model.updated(&mut self.adam, &step, gradients);
        let step = self.focal_step(step);
        let applied = focal.map(|focal| self.adam.apply(&step, FOCAL, focal, gradients));
        self.model.focal = match self.config.learned_camera() {
            Some(camera) => applied.map(|focal| focal.held_to(camera)),
            None => applied,
        };
    }
}

impl Model {
    /// Adds a loss' gradients to those of a step, `scale` times.
    pub fn add_gradients(&self, total: &Tensor<1>, scale: f32, step: &mut NamedGradients) {
        let mut raw = total.backward();
        step.add("depth", &self.depth_net, &mut raw, scale);
        step.add("pose", &self.pose_net, &mut raw, scale);
        if let Some(decoder) = &self.flow_decoder {
            step.add("flow", decoder, &mut raw, scale);
        }
        if let Some(focal) = &self.focal {
            step.add(FOCAL, focal, &mut raw, scale);
        }
    }

    /// The networks after a step of the optimiser. A learned focal length stays: its step is another.
    #[must_use]
    pub fn updated(self, adam: &mut Adam, step: &AdamStep, gradients: &NamedGradients) -> Self {
        Self {
            depth_net: adam.apply(step, "depth", self.depth_net, gradients),
            pose_net: adam.apply(step, "pose", self.pose_net, gradients),
            flow_decoder: self
                .flow_decoder
                .map(|decoder| adam.apply(step, "flow", decoder, gradients)),
            ..self
        }
    }
}

/// The loaders of the training data.
pub(super) struct Loaders {
    video: Option<BatchLoader>,
    depth: Option<DepthLoader>,
}

impl Loaders {
    /// From a step on, this worker's batches: of K workers every K-th.
    pub(super) fn training(
        config: &TrainConfig,
        set: &SampleSet,
        step: usize,
        workers: &WorkerGroup,
    ) -> Self {
        let (rank, count) = (workers.rank(), workers.count());
        let first = step * config.accumulate * count + rank;
        let numbers = move || (first..).step_by(count);
        let video = !set.samples.is_empty();
        Self {
            video: video
                .then(|| BatchLoader::training_batches(config, set.clone(), numbers(), count)),
            depth: (!set.depth.is_empty()).then(|| {
                DepthLoader::training_batches(config, set.depth.clone(), numbers(), count)
            }),
        }
    }
}

/// What a worker has learned from its part of a step.
#[derive(Default)]
pub(super) struct WorkerStep {
    pub(super) gradients: NamedGradients,
    pub(super) losses: LossTerms,
    /// Drives and frames.
    pub(super) names: Vec<String>,
    pub(super) images: usize,
    pub(super) panel: Option<PanelInput>,
    pub(super) monitors: Monitors,
}

/// Figures of each batch that are smoothed over the steps.
#[derive(Default)]
pub(super) struct Monitors {
    pub(super) ratio: Vec<f64>,
    pub(super) valid: Vec<f64>,
    pub(super) moving: Vec<f64>,
}

/// What a panel shows.
pub(super) enum PanelInput {
    View(Box<(ForwardPass, BatchLoss, String)>),
    Depth(Box<(DepthPass, DepthBatch)>),
}

impl PanelInput {
    pub(super) fn panel(self) -> SamplePanel {
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
            reason: LoaderProblem::NoBatch,
        })
    })
}
