//! Runs networks over whole recordings and folders.
//!
//! | Module | What it does |
//! |---|---|
//! | [`evaluation`] | compares predictions with ground truth, next to the mean-depth baseline; how far a pixel can be trusted |
//! | [`intervals`] | checks the intervals of a network that predicts uncertainty, and calibrates them |
//! | [`TargetFinder`] | finds 3D targets frame by frame, and tracks them |
//! | [`labelled`] | compares 3D targets with labelled boxes |
//! | [`bulk`] | bulk prediction: each image's outputs exactly once, on any number of machines |
//! | [`outputs`] | what is written for an image: depth in many forms, drawn targets, the sidecar |
//! | [`live`] | live cameras and streams: always the newest frame |
//! | [`scene`] | how the camera moved from frame to frame, and whether the scale drifts |
//! | [`verdict`] | what a drive with speeds shows about a network's depth, without ground truth |
//! | [`board`] | finds a calibration board in pictures and videos |
//! | [`int8`] | measures the input ranges of a network's convolutions, for int8 |
//! | [`averaging`] | averages the weights of several runs |
//! | [`packing`] | packs a run's network into a file of its own, with its card |
//! | [`devices`], [`engine`] | where a network computes, and which engine runs it |
//! | [`bench`](mod@bench) | measures the speed of a network and of every stage around it |
//! | [`machine`] | what this machine has: vector instructions, memory, disk, external programs |
//! | [`importing`] | other projects' weights: which are known, and (with the feature `train`) how to make a run of them |
//! | [`RunHistory`] | how a run's training went, from the files in its folder |
//! | [`recordings`], [`held_out`] | the recordings of a configuration; whether training has seen the evaluated frames |
#![cfg_attr(
    feature = "train",
    doc = "| [`samples`] | the samples that a configuration is trained and validated on |"
)]
#![cfg_attr(
    feature = "train",
    doc = "| [`export`] | exports a network as an ONNX file and compares the two |"
)]
#![cfg_attr(
    feature = "train",
    doc = "| [`device_check`] | checks whether a device computes the same as the processor, in processes that its driver may crash |"
)]
#![cfg_attr(
    feature = "train",
    doc = "| [`odometry`] | compares the pose network's trajectory with the true one |"
)]
#![cfg_attr(
    feature = "train",
    doc = "| [`training`] | what a run starts from and what it writes; adapting a network to new drives; ablation tables |"
)]
#![cfg_attr(
    feature = "train",
    doc = "| [`demo`] | the whole workflow without any data, on simulated streets |"
)]
//!
//! Nothing here prints. Messages for people are returned, or passed to a callback.

pub mod averaging;
pub mod bench;
pub mod board;
pub mod bulk;
pub mod dates;
#[cfg(feature = "train")]
pub mod demo;
#[cfg(feature = "train")]
pub mod device_check;
pub mod devices;
mod drives;
pub mod duration;
pub mod engine;
mod error;
pub mod evaluation;
#[cfg(feature = "train")]
pub mod export;
mod figures;
mod files;
pub mod held_out;
pub mod importing;
mod inputs;
pub mod int8;
pub mod intervals;
pub mod labelled;
pub mod live;
pub mod machine;
mod model_facts;
#[cfg(feature = "train")]
pub mod odometry;
pub mod outputs;
pub mod packing;
mod perception_settings;
pub mod recordings;
mod run_history;
#[cfg(feature = "train")]
pub mod samples;
pub mod scene;
mod stale_calibration;
mod target_finder;
#[cfg(feature = "train")]
pub mod training;
pub mod verdict;

pub use error::{Error, NoMean, OtherJob, Result, StaleReason, UnfitCamera};
pub use inputs::{Input, find_inputs, first_of_each};
pub use model_facts::{ModelFacts, name_of};
pub use perception_settings::perception_settings;
pub use run_history::RunHistory;
pub use stale_calibration::StaleCalibration;
pub use target_finder::{PerceivedFrame, StartedFrame, TargetFinder, TargetSettings};
