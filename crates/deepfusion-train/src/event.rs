use crate::{LossTerms, SamplePanel, TrainWarning};
use deepfusion_geometry::Intrinsics;
use deepfusion_model::LearnedCamera;
use std::path::PathBuf;

/// What the trainer reports. It never prints; the caller decides what to do with its events.
#[derive(Debug, Clone)]
pub enum TrainEvent {
    /// Training begins or resumes.
    Started {
        /// Steps already done.
        from_step: usize,
        /// Steps of the whole run.
        steps: usize,
        /// Training samples.
        samples: usize,
        /// Of these, recorded images with known depth.
        known_depth: usize,
        /// Of these, simulated images.
        simulated: usize,
        /// Held-out samples.
        validation_samples: usize,
        /// The data's mean displacement per pair, in metres.
        mean_displacement_m: f64,
    },
    /// A step of the optimiser was made or skipped. On a GPU the numbers of several steps are read together; their events then come one
    /// right after the other.
    Step {
        /// Counted from 1.
        step: usize,
        /// Steps of the whole run.
        steps: usize,
        /// The loss of the step's samples, the mean over its batches if several are accumulated.
        losses: LossTerms,
        /// The learning rate.
        learning_rate: f64,
        /// Images per second, targets and sources, over the last steps.
        images_per_second: f64,
        /// Seconds until the end at the present pace.
        remaining_s: f64,
        /// Displacement by the vehicle's speed over displacement by PoseNet, smoothed over the last steps: 1 when the scale is metric.
        /// Without PoseNet, or for known depth alone, true over predicted depth; NaN if the run learns from neither.
        scale_ratio: f64,
        /// Norm of the gradient before clipping.
        gradient_norm: f64,
    },
    /// The held-out samples were evaluated.
    Validated {
        /// Steps done.
        step: usize,
        /// Their loss.
        losses: LossTerms,
        /// The value that selects `best`: the part of the loss that depth can change.
        selection: f64,
        /// As in [`TrainEvent::Step`].
        scale_ratio: f64,
        /// Whether this is the best so far.
        best: bool,
    },
    /// The networks' outputs for a training image.
    Panel {
        /// Steps done.
        step: usize,
        /// The panel.
        panel: Box<SamplePanel>,
    },
    /// A checkpoint was written.
    Saved {
        /// Steps done.
        step: usize,
        /// Path of the checkpoint.
        path: PathBuf,
    },
    /// The camera that the run has learned, at its end or when it is stopped.
    Camera {
        /// The camera, at the size of the images.
        camera: Intrinsics,
        /// Its focal lengths, and how well the drives determined them.
        learned: LearnedCamera,
    },
    /// Something looks wrong, but training continues.
    Warning {
        /// Steps done.
        step: usize,
        /// What looks wrong, with its numbers.
        warning: TrainWarning,
    },
}

/// What the listener wants the trainer to do next.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Control {
    /// Continue training.
    Continue,
    /// Save a checkpoint and stop after the steps made so far.
    Stop,
}
