//! Trains metric depth on drives: view synthesis, losses, the trainer and its checkpoints.
//!
//! A training step: [`Sampler`] → [`SnippetBatch`] → [`Model`] → [`synthesise`] →
//! [`LossTerms`] → [`Adam`] → [`TrainEvent`]. The trainer prints nothing: it passes events
//! to its caller.

mod adam;
mod augment;
mod batch;
mod broken_images;
mod checkpoint;
mod depth_batch;
mod depth_set;
pub mod device_check;
mod error;
mod event;
mod factors;
mod fit_depth;
mod focal_spread;
mod freeze;
mod inspector;
mod learned_focal;
mod level;
mod loader;
pub mod log;
pub mod losses;
mod model;
mod objective;
mod panel;
mod pose;
mod pose_predictor;
mod runner;
mod sampler;
mod selection;
mod shared_frames;
mod source;
mod stereo;
mod trainer;
mod unread;
mod view_synthesis;
mod warning;
mod window;
mod workers;

/// The device on which networks are trained: `Device::flex()` is the CPU.
pub use burn::tensor::Device;

pub use adam::{Adam, NamedGradients, PreparedStep, StepOutcome};
pub use augment::Jitter;
pub use batch::{BatchLoader, SnippetBatch};
pub use checkpoint::Checkpoints;
pub use deepfusion_model::{
    AssumedCamera, Augmentation, CHECKPOINT_VERSION, Checkpoint, CheckpointKind, CompareAt,
    Compute, ConfigKey, DataConfig, DataSetConfig, DepthLossConfig, FlowLossConfig, Learn,
    LearnedCamera, LearningRateSchedule, LossConfig, MovingConfig, Preset, Reprojection,
    ReversedPose, RunFolder, SampleFactors, SetFindings, SimulatedCamera, SimulatedConfig,
    StoredNetwork, TrainConfig, TrainFindings, ViewMotion, config_keys,
};
pub use deepfusion_nn::BilinearResize;
pub use depth_batch::{DepthBatch, DepthLoader};
pub use depth_set::{DepthFrame, DepthSet, DepthView, SimulatedViews};
pub use error::{
    Error, LoaderProblem, NoStereo, SampleProblem, SharedFrames, Skipped, ThreadsProblem,
    WorkersProblem,
};
pub use event::{Control, TrainEvent};
pub use factors::BatchFactors;
pub use inspector::Inspector;
pub use learned_focal::LearnedFocal;
pub use losses::LossTerms;
pub use model::{ForwardPass, Model, ViewFlow};
pub use objective::{BatchLoss, DepthPass, Schedule};
pub use panel::{SamplePanel, Supervision};
pub use pose::{Motion, rotation_from_axis_angle};
pub use pose_predictor::PosePredictor;
pub use runner::{BurnRunner, depth_net, peak_device_bytes};
pub use sampler::Sampler;
pub use shared_frames::shared_frames;
pub use source::{Sample, SampleSet};
pub use stereo::{StereoSource, recordings_with_stereo};
pub use trainer::{TrainSummary, Trainer, validation_loss};
pub use view_synthesis::{Synthesised, synthesise};
pub use warning::TrainWarning;
pub use workers::{SingleWorker, Workers};
