//! A network over whole recordings and folders.
//!
//! | Module | What it does |
//! |---|---|
//! | [`evaluation`] | predictions against ground truth, beside the mean-depth baseline; how far a pixel can be trusted |
//! | [`intervals`] | whether the intervals hold of a network that says how sure it is, and by how much they are stretched |
//! | [`TargetFinder`] | frame after frame to 3D targets, followed over time |
//! | [`labelled`] | 3D targets against labelled boxes |
//! | [`bulk`] | images in, outputs exactly once, on any number of machines |
//! | [`outputs`] | what is written of an image: depth in many forms, targets drawn, the sidecar |
//! | [`live`] | a camera or a stream: always the newest frame |
//! | [`scene`] | how the camera moved from frame to frame, and whether metres still are what they were |
//! | [`verdict`] | what a drive with speeds says of a network's depth, without ground truth |
//! | [`board`] | the board of a calibration in pictures and videos |
//! | [`int8`] | the ranges of what a network's convolutions read, for int8 |
//! | [`averaging`] | the mean of several runs' weights |
//! | [`packing`] | a run's network as a file of its own, with its card |
//! | [`devices`], [`engine`] | where a network computes, and what runs it there |
//! | [`bench`](mod@bench) | how fast a network is, and every stage around it |
//! | [`machine`] | what this machine has: vector instructions, memory, disk, programs from outside |
//! | [`importing`] | other projects' weights: which are known, and with the feature `train` as a run |
//! | [`RunHistory`] | how a run learned, by what its folder keeps |
//! | [`recordings`], [`held_out`] | the recordings of a configuration; whether training saw what is measured on |
#![cfg_attr(
    feature = "train",
    doc = "| [`samples`] | the samples that a configuration is trained and validated with |"
)]
#![cfg_attr(
    feature = "train",
    doc = "| [`export`] | a network as an ONNX file, compared with it |"
)]
#![cfg_attr(
    feature = "train",
    doc = "| [`device_check`] | whether a device computes what the processor does, in processes that its driver may end |"
)]
#![cfg_attr(
    feature = "train",
    doc = "| [`odometry`] | the pose network's path beside the true one |"
)]
#![cfg_attr(
    feature = "train",
    doc = "| [`training`] | what a run starts from and what it leaves; adapting a network to new drives; the table of an ablation |"
)]
#![cfg_attr(
    feature = "train",
    doc = "| [`demo`] | the whole way with no data at all, on simulated streets |"
)]
//!
//! Nothing here prints. What a person should know is returned, or passed to a callback.

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
