//! What one worker learns from its part of a step: losses, and their gradients by name; and the step of the optimiser.

use super::Trainer;
use crate::model::displacements;
use crate::unread::{Unread, read_at_once};
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
    ///
    /// # Errors
    /// [`Error::NotFinite`] of the first batch with such a loss, else that of a batch that could not be made.
    pub(super) fn learn(&self, loaders: &Loaders, schedule: Schedule) -> Result<WorkerStep, Error> {
        let mut learned = WorkerStep::default();
        let learning = self.learn_batches(loaders, schedule, &mut learned);
        // Of what failed, a loss that waits to be read was the first.
        self.read(&mut learned)?;
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
                let batch = self.model().see(next(|| loader.next(&self.device))?);
                learned.images += batch.len() * (1 + batch.offsets.len());
                let (pass, loss, mut numbers) = autocast(self.config.precision, || {
                    let pass = self.model().forward(&batch);
                    let (loss, numbers) = self.model().loss_on_device(&pass, &batch, schedule);
                    (pass, loss, numbers)
                });
                let says_scale = self.model().pose_net.is_some();
                if says_scale {
                    numbers.note_displacements(displacements(&pass, &batch));
                }
                self.note(
                    learned,
                    UnreadBatch {
                        numbers,
                        names: batch.names.clone(),
                        is_video: true,
                        says_scale,
                    },
                )?;
                self.model()
                    .add_gradients(&loss.total, scale as f32, &mut learned.gradients);
                // The pass's first target is the batch's first sample.
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
                        says_scale: loaders.video.is_none() || self.model().pose_net.is_none(),
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

    /// Keeps a batch's numbers. Where they are not read late, they are read now.
    fn note(&self, learned: &mut WorkerStep, batch: UnreadBatch) -> Result<(), Error> {
        learned.unread.push(batch);
        if self.reads_late {
            return Ok(());
        }
        self.read(learned)
    }

    /// Reads the numbers of the batches that wait for it: a single transfer from the device. Where they are read late it is a single worker's
    /// only one in a step, with the norm of its gradient; several workers read their gradients, too. A step needs it before it changes anything: a loss that is not finite
    /// ends the run, such a gradient skips the step, and Adam counts those that were made.
    fn read(&self, learned: &mut WorkerStep) -> Result<(), Error> {
        let batches = std::mem::take(&mut learned.unread);
        // What several workers clip is the mean of their gradients.
        let norm_is_due = self.reads_late && self.workers.count() == 1;
        let squares = norm_is_due.then(|| learned.gradients.squares());
        let on_device = squares.as_ref().and_then(|squares| squares.1.clone());
        let unread: Vec<&Unread> = batches.iter().map(|batch| &batch.numbers).collect();
        let (numbers, on_device) = read_at_once(&unread, on_device);
        let scale = 1.0 / self.config.accumulate as f64;
        for (batch, numbers) in batches.iter().zip(numbers) {
            let terms = &numbers.terms;
            self.check_finite(terms, &batch.names)?;
            learned.losses.add(terms, scale);
            if batch.is_video {
                learned.monitors.valid.push(terms.valid_share);
                learned.monitors.moving.push(terms.moving_share);
            }
            if batch.says_scale {
                learned.monitors.ratio.push(numbers.scale_ratio);
            }
        }
        learned.gradient_norm =
            squares.map(|(on_host, _)| (on_host + on_device.unwrap_or(0.0)).sqrt());
        Ok(())
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
        // Moved, not cloned: what nobody else holds is changed where it is.
        let Some(model) = self.model.take() else {
            return;
        };
        let mut model = model.updated(&mut self.adam, &step, gradients);
        let step = self.focal_step(step);
        let focal = model.focal.take();
        let applied = focal.map(|focal| self.adam.apply(&step, FOCAL, focal, gradients));
        model.focal = match self.config.learned_camera() {
            Some(camera) => applied.map(|focal| focal.held_to(camera)),
            None => applied,
        };
        self.model = Some(model);
    }
}

impl Model {
    /// Adds a loss' gradients to those of a step, `scale` times.
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

    /// The networks after a step of the optimiser. A learned focal length stays: its step is another.
    #[must_use]
    pub fn updated(self, adam: &mut Adam, step: &AdamStep, gradients: &NamedGradients) -> Self {
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
    /// Norm of the gradients, where it was read with the losses.
    pub(super) gradient_norm: Option<f64>,
    /// Batches of which losses and monitors lack the numbers.
    unread: Vec<UnreadBatch>,
}

/// A batch whose numbers are still on the device.
struct UnreadBatch {
    numbers: Unread,
    /// Drives and frames.
    names: Vec<String>,
    is_video: bool,
    /// Whether its scale is the run's: known depth says it only where no PoseNet on video does.
    says_scale: bool,
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
