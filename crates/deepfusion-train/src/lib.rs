//! Learning metric depth from a drive: view synthesis, losses, the trainer and its checkpoints.
//!
//! The way of a training step: [`Sampler`] → [`SnippetBatch`] → [`Model`] → [`synthesise`] →
//! [`LossTerms`] → [`Adam`] → [`TrainEvent`]. The trainer prints nothing: whoever runs it reads its
//! events.

mod adam;
mod augment;
mod batch;
mod checkpoint;
mod config;
mod config_file;
mod config_keys;
mod data_set;
mod depth_batch;
mod depth_set;
mod error;
mod event;
mod factors;
mod fit_depth;
mod inspector;
mod level;
mod loader;
pub mod log;
mod loss_config;
pub mod losses;
mod model;
mod objective;
mod panel;
mod pose;
mod pose_predictor;
mod predictor;
mod prepare;
mod preset;
mod runner;
mod sampler;
mod selection;
mod shared_frames;
mod source;
mod stored;
mod trainer;
mod view_synthesis;
mod window;

pub use adam::{Adam, NamedGradients, StepOutcome};
pub use augment::Jitter;
pub use batch::{BatchLoader, SnippetBatch};
pub use checkpoint::{CHECKPOINT_VERSION, Checkpoint, CheckpointKind, RunFolder};
pub use config::{
    Augmentation, DataConfig, LearningRateSchedule, Reprojection, ReversedPose, TrainConfig,
    ViewMotion,
};
pub use config_keys::{ConfigKey, config_keys};
pub use data_set::{DataSetConfig, Learn, SimulatedConfig};
pub use deepfusion_nn::BilinearResize;
pub use depth_batch::{DepthBatch, DepthLoader};
pub use depth_set::{DepthFrame, DepthSet, DepthView, SimulatedViews};
pub use error::Error;
pub use event::{Control, TrainEvent};
pub use factors::{BatchFactors, SampleFactors};
pub use inspector::{FeatureMap, Inspector, LayerMaps};
pub use loss_config::{CompareAt, DepthLossConfig, FlowLossConfig, LossConfig, MovingConfig};
pub use losses::LossTerms;
pub use model::{ForwardPass, Model, ViewFlow};
pub use objective::{BatchLoss, DepthPass, Schedule};
pub use panel::{Lesson, SamplePanel};
pub use pose::{Motion, rotation_from_axis_angle};
pub use pose_predictor::PosePredictor;
pub use predictor::{Prediction, Predictor};
pub use prepare::{PreparedImage, Preparer, fitting};
pub use preset::{Compute, Preset};

pub use runner::{BurnRunner, DepthRunner, FusedRunner, NetworkOutput};
pub use sampler::Sampler;
pub use shared_frames::{SharedFrames, shared_frames};
pub use source::{Sample, SampleSet};
pub use stored::StoredNetwork;
pub use trainer::{TrainSummary, Trainer, validation_loss};
pub use view_synthesis::{Synthesised, synthesise};
