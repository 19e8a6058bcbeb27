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
//! [`ModelSource`] finds a network, and [`DepthEstimator`] runs it on a [`DepthRunner`]: the fused engine ([`FusedRunner`]), ONNX Runtime
//! ([`OrtRunner`]), or any other that gives disparities. Give each thread its own estimator ([`DepthEstimator::another`]); no lock is
//! needed. Estimators on the fused engine share one copy of the packed weights, while each session of ONNX Runtime packs its own. If you
//! have time to spare, use test-time augmentation ([`Augmentation`]), which averages several predictions of one image.

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
