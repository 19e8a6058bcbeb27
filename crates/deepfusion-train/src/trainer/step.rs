//! One worker's part of a step: its losses, their gradients by name, and the step of the optimiser.

use super::Trainer;
use super::figures::{Figures, UnreadBatch, UnreadStep};
use crate::model::displacements;
use crate::unread::read_at_once;
use crate::workers::WorkerGroup;
use crate::{
    Adam, BatchLoader, BatchLoss, DepthBatch, DepthLoader, DepthPass, Error, ForwardPass,
    LoaderProblem, Model, NamedGradients, PreparedStep, SamplePanel, SampleSet, Schedule,
    TrainConfig,
};
use burn::tensor::Tensor;
use deepfusion_nn::ops::autocast;

/// The name of the focal length among parameters and moments.
const FOCAL: &str = "focal";

impl Trainer {
    /// Whether the device decides about steps, and the numbers of several steps are read together. Not with several workers: they clip the
    /// mean of their gradients, which passes through main memory anyway.
    pub(super) fn decides_on_device(&self) -> bool {
        self.reads_late && self.workers.count() == 1
    }

    /// Losses and gradients of this worker's part of a step: the means over its `accumulate` batches. If the device decides about the step,
    /// the losses are still there.
    ///
    /// # Errors
    /// [`Error::NotFinite`] for the first batch with such a loss, else the error of a batch that could not be made.
    pub(super) fn learn(&self, loaders: &Loaders, schedule: Schedule) -> Result<WorkerStep, Error> {
        let mut learned = WorkerStep::default();
        if self.reads_late {
            learned.gradients = NamedGradients::on_device();
        }
        let learning = self.learn_batches(loaders, schedule, &mut learned);
        if learning.is_err() || !self.decides_on_device() {
            // A loss of an earlier batch that is not finite comes before the error.
            self.read(&mut learned)?;
        }
        learning.map(|()| learned)
    }

    fn learn_batches(
        &self,
        loaders: &Loaders,
        schedule: Schedule,
        learned: &mut WorkerStep,
    ) -> Result<(), Error> {
        let scale = 1.0 / self.config.accumulate as f64;
        for _ in 0..self.config.accumulate {
            if let Some(loader) = &loaders.video {
                let batch = self
                    .model()
                    .with_learned_camera(next(|| loader.next(&self.device))?);
                learned.images += batch.len() * (1 + batch.offsets.len());
                let (pass, loss, mut numbers) = autocast(self.config.precision, || {
                    let pass = self.model().forward(&batch);
                    let (loss, numbers) = self.model().loss_on_device(&pass, &batch, schedule);
                    (pass, loss, numbers)
                });
                let gives_scale = self.model().pose_net.is_some();
                if gives_scale {
                    numbers.note_displacements(displacements(&pass, &batch));
                }
                self.note(
                    learned,
                    UnreadBatch {
                        numbers,
                        names: batch.names.clone(),
                        is_video: true,
                        gives_scale,
                    },
                )?;
                self.model()
                    .add_gradients(&loss.total, scale as f32, &mut learned.gradients);
                // The first target of the pass is the batch's first sample.
                let shown = batch.names.first().cloned().unwrap_or_default();
                learned.names.extend(batch.names);
                learned.panel = Some(PanelInput::View(Box::new((pass, loss, shown))));
            }
            if let Some(loader) = &loaders.depth {
                let batch = next(|| loader.next(&self.device))?;
                learned.images += batch.len();
                let (pass, numbers) = autocast(self.config.precision, || {
                    self.model().learn_depth_on_device(&batch)
                });
                self.note(
                    learned,
                    UnreadBatch {
                        numbers,
                        names: batch.names.clone(),
                        is_video: false,
                        gives_scale: loaders.video.is_none() || self.model().pose_net.is_none(),
                    },
                )?;
                self.model()
                    .add_gradients(&pass.total, scale as f32, &mut learned.gradients);
                learned.names.extend(batch.names.iter().cloned());
                let panel = learned.panel.take();
                learned.panel = panel.or(Some(PanelInput::Depth(Box::new((pass, batch)))));
            }
        }
        Ok(())
    }

    /// Keeps a batch's numbers, and reads them now unless the trainer reads late.
    fn note(&self, learned: &mut WorkerStep, batch: UnreadBatch) -> Result<(), Error> {
        learned.unread.push(batch);
        if self.reads_late {
            return Ok(());
        }
        self.read(learned)
    }

    /// Reads the numbers of all unread batches in a single transfer from the device.
    fn read(&self, learned: &mut WorkerStep) -> Result<(), Error> {
        let mut batches = std::mem::take(&mut learned.unread);
        let mut unread: Vec<_> = batches.iter_mut().map(|b| &mut b.numbers).collect();
        let numbers = read_at_once(&mut unread);
        let (share, step) = (1.0 / self.config.accumulate as f64, self.state.step + 1);
        for (batch, numbers) in batches.iter().zip(&numbers) {
            learned.figures.add(batch, numbers, share, step)?;
        }
        Ok(())
    }

    /// A step that the device decides about: it is made if all losses and the gradient's norm are finite.
    pub(super) fn step_on_device(
        &mut self,
        mut batches: Vec<UnreadBatch>,
        gradients: &NamedGradients,
        learning_rate: f64,
    ) -> UnreadStep {
        let mut terms = Vec::new();
        for batch in &mut batches {
            terms.extend(batch.numbers.take_terms());
        }
        let losses = Tensor::cat(terms, 0);
        // No gradients are in main memory.
        let (_, squares) = gradients.squares();
        let squares = squares.unwrap_or_else(|| Tensor::zeros([1], &losses.device()));
        let (is_made, step) = self.adam.begin_on_device(
            (losses.clone(), squares.clone()),
            learning_rate,
            self.config.clip_norm,
            self.config.weight_decay,
        );
        self.apply(step, gradients);
        UnreadStep::new(batches, [losses, squares], is_made)
    }

    /// Applies a step of the optimiser to the networks and the learned focal length.
    pub(super) fn apply(&mut self, step: PreparedStep, gradients: &NamedGradients) {
        // Moved, not cloned: tensors with a single owner are updated in place.
        let Some(model) = self.model.take() else {
            return;
        };
        let mut model = model.updated(&mut self.adam, &step, gradients);
        let step = self.focal_step(step);
        let focal = model.focal.take();
        let applied = focal.map(|focal| self.adam.apply(&step, FOCAL, focal, gradients));
        model.focal = match self.config.learned_camera() {
            Some(camera) => applied.map(|focal| focal.clamped_to(camera)),
            None => applied,
        };
        self.model = Some(model);
    }
}

impl Model {
    /// Adds a loss's gradients, times `scale`, to those of a step.
    pub fn add_gradients(&self, total: &Tensor<1>, scale: f32, step: &mut NamedGradients) {
        let mut raw = total.backward();
        step.add("depth", &self.depth_net, &mut raw, scale);
        if let Some(pose_net) = &self.pose_net {
            step.add("pose", pose_net, &mut raw, scale);
        }
        if let Some(decoder) = &self.flow_decoder {
            step.add("flow", decoder, &mut raw, scale);
        }
        if let Some(focal) = &self.focal {
            step.add(FOCAL, focal, &mut raw, scale);
        }
    }

    /// The networks after a step of the optimiser. A learned focal length stays the same: it has a step of its own.
    #[must_use]
    pub fn updated(self, adam: &mut Adam, step: &PreparedStep, gradients: &NamedGradients) -> Self {
        Self {
            depth_net: adam.apply(step, "depth", self.depth_net, gradients),
            pose_net: self
                .pose_net
                .map(|pose_net| adam.apply(step, "pose", pose_net, gradients)),
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
    /// This worker's batches from a step on: every K-th batch for K workers.
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

/// The results of a worker's part of a step.
#[derive(Default)]
pub(super) struct WorkerStep {
    pub(super) gradients: NamedGradients,
    pub(super) figures: Figures,
    /// Drives and frames of the samples.
    pub(super) names: Vec<String>,
    pub(super) images: usize,
    pub(super) panel: Option<PanelInput>,
    /// Batches whose numbers are not in `figures` yet.
    pub(super) unread: Vec<UnreadBatch>,
}

/// What a panel is made from.
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
