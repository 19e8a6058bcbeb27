//! The whole workflow without any data: simulating, training, evaluating, and the page with the results.
//!
//! [`new_street`] shows a given network zero-shot on a street it has never seen, and what fine-tuning there from images and motion adds.
//! [`from_scratch`] trains a small network on simulated streets and evaluates it on another. The caller simulates the drives, runs the
//! trainer and the network, and can stop between two frames.

pub mod from_scratch;
mod measure;
pub mod new_street;
mod settings;
mod shown_prediction;

pub use self::measure::measure;
pub use self::settings::{DemoFolder, DemoSettings};
pub use self::shown_prediction::ShownPrediction;
