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
mod data_set;
mod error;
mod event;
mod factors;
mod inspector;
mod level;
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

pub use adam::{Adam, NamedGradients, StepOutcome};
pub use augment::Jitter;
pub use batch::{BatchLoader, SnippetBatch};
pub use checkpoint::{CHECKPOINT_VERSION, Checkpoint, CheckpointKind, RunFolder};
pub use config::{Augmentation, DataConfig, Reprojection, ReversedPose, TrainConfig, ViewMotion};
pub use data_set::DataSetConfig;
pub use deepfusion_nn::BilinearResize;
pub use error::Error;
pub use event::{Control, TrainEvent};
pub use factors::BatchFactors;
pub use inspector::{FeatureMap, Inspector, LayerMaps};
pub use loss_config::{CompareAt, FlowLossConfig, LossConfig, MovingConfig};
pub use losses::LossTerms;
pub use model::{ForwardPass, Model, ViewFlow};
pub use objective::{BatchLoss, Schedule};
pub use panel::SamplePanel;
pub use pose::{Motion, rotation_from_axis_angle};
pub use pose_predictor::PosePredictor;
pub use predictor::{Prediction, Predictor};
pub use prepare::{PreparedImage, Preparer};
pub use preset::{Compute, Preset};

pub use runner::{BurnRunner, DepthRunner, FusedRunner};
pub use sampler::Sampler;
pub use shared_frames::{SharedFrames, shared_frames};
pub use source::{Sample, SampleSet};
pub use stored::StoredNetwork;
pub use trainer::{TrainSummary, Trainer, validation_loss};
pub use view_synthesis::{Synthesised, synthesise};
