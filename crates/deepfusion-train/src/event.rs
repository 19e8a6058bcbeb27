use crate::{LossTerms, SamplePanel, TrainWarning};
use deepfusion_geometry::Intrinsics;
use deepfusion_model::LearnedCamera;
use std::path::PathBuf;

/// What the trainer reports. It never prints; the caller decides what to do with its events.
#[derive(Debug, Clone)]
pub enum TrainEvent {
    /// Training begins, or goes on.
    Started {
        /// Steps already done.
        from_step: usize,
        /// Steps of the whole run.
        steps: usize,
        /// Training samples.
        samples: usize,
        /// Of these, images with known depth that were recorded.
        known_depth: usize,
        /// And those that are simulated.
        simulated: usize,
        /// Held-out samples.
        validation_samples: usize,
        /// The data's mean displacement per pair, in metres.
        mean_displacement_m: f64,
    },
    /// A step of the optimiser was made, or skipped. On a GPU the numbers of some steps are read together, and their events come one after
    /// the other then.
    Step {
        /// Counted from 1.
        step: usize,
        /// Steps of the whole run.
        steps: usize,
        /// The loss of the step's samples, the mean over its batches where several are accumulated.
        losses: LossTerms,
        /// The learning rate.
        learning_rate: f64,
        /// Images per second, targets and sources, over the last steps.
        images_per_second: f64,
        /// Seconds until the end at the present pace.
        remaining_s: f64,
        /// Displacement by the vehicle's speed over displacement by PoseNet, smoothed over the last
        /// steps: 1 when the scale is metric. Of known depth alone and without PoseNet, true over predicted depth; NaN where neither is learned from.
        scale_ratio: f64,
        /// Norm of the gradient before clipping.
        gradient_norm: f64,
    },
    /// The held-out samples were evaluated.
    Validated {
        /// After this step.
        step: usize,
        /// Their loss.
        losses: LossTerms,
        /// The value that selects `best`: the part of the loss that depth can change.
        selection: f64,
        /// As of a step.
        scale_ratio: f64,
        /// Whether this is the best so far.
        best: bool,
    },
    /// A picture of what is being learned.
    Panel {
        /// After this step.
        step: usize,
        /// The images.
        panel: Box<SamplePanel>,
    },
    /// A checkpoint was written.
    Saved {
        /// After this step.
        step: usize,
        /// The file.
        path: PathBuf,
    },
    /// The camera that the run has learned, at its end or where it was stopped.
    Camera {
        /// The camera, at the size of the images.
        camera: Intrinsics,
        /// Its focal lengths, and how well the drives determined them.
        learned: LearnedCamera,
    },
    /// Something looks wrong but training goes on.
    Warning {
        /// After this step.
        step: usize,
        /// What, with its figures.
        warning: TrainWarning,
    },
}

/// What the listener wants the trainer to do next.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Control {
    /// Go on.
    Continue,
    /// Save and stop, after the last step that was made.
    Stop,
}
