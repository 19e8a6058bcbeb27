//! Runs trained depth networks without the training framework: image and camera in, metres out.
//!
//! ```no_run
//! # fn main() -> Result<(), Box<dyn std::error::Error>> {
//! use deepfusion_runtime::DepthEstimator;
//!
//! let mut estimator = DepthEstimator::load("street")?;
//! let photo = deepfusion_images::load_photo("street.jpg".as_ref())?;
//! let depth = estimator.estimate(&photo.image, photo.intrinsics.as_ref())?.depth();
//! println!("the middle is {:.1} m away", depth.data[depth.data.len() / 2]);
//! # Ok(())
//! # }
//! ```
//!
//! [`ModelSource`] finds a network, [`DepthEstimator`] runs it on a [`DepthRunner`]: the fused engine ([`FusedRunner`]),
//! ONNX Runtime ([`OrtRunner`]), or any other that yields disparities. Every thread has its own estimator
//! ([`DepthEstimator::another`]). Those of the fused engine share one copy of the packed weights (each session of ONNX Runtime packs its own), and no lock
//! is needed. With time to spare, a prediction may be the mean of several of one image: test-time augmentation ([`Augmentation`]).

mod augmentation;
mod error;
mod estimator;
mod fused;
mod ort;
mod other_sizes;
mod prediction;
mod prepare;
mod resample;
mod runner;
mod source;

pub use augmentation::Augmentation;
pub use deepfusion_infer::{Precision, SeenInputs};
pub use error::{EngineProblem, Error};
pub use estimator::DepthEstimator;
pub use fused::FusedRunner;
pub use ort::OrtRunner;
pub use prediction::Prediction;
pub use prepare::{PreparedImage, Preparer, View, fitting};
pub use runner::{DepthRunner, FeatureMap, LayerMaps, NetworkOutput, RunnerPlan, metric_disparity};
pub use source::{
    HiddenByRun, ModelSource, embedded, embedded_names, embedded_unless_run, hidden_by_run,
    unpacked,
};
