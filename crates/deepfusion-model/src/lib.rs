//! The networks' configurations and weights, without a framework to train them.
//!
//! - [`DepthNetConfig`], [`PoseNetConfig`] and their parts describe a network; [`ModuleCost`] is what a part costs.
//! - [`TrainConfig`] is everything that decides a training run, as stored in a run's `config.toml`.
//! - [`weights`] are tensors by name, in memory and in safetensors files.
//! - [`RunFolder`] is a run on disk; [`StoredNetwork`] the trained depth network of one, or of a packed file.
//! - [`depth_graph`] turns configuration and weights into the graph that `deepfusion-infer` runs and `deepfusion-onnx` writes.

mod error;
mod graph;
mod int8;
mod network;
mod run_folder;
mod stored;
mod training;
pub mod weights;

pub use error::{
    AskedBy, CHECKPOINT_VERSION, CheckpointLacks, Error, ExpectedDataSet, ExpectedSetting,
    FoundSetting, NoRun, SettingProblem, TomlProblem,
};
pub use graph::{depth_graph, depth_graph_with_uncertainty};
pub use int8::{CalibrationProblem, Int8Calibration, UnreadableCalibration};
pub use network::*;
pub use run_folder::{Checkpoint, CheckpointKind, RunFolder};
pub use stored::StoredNetwork;
pub use training::*;
