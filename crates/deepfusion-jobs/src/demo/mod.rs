//! The whole way with no data at all: what is simulated, what is learned there and how, what is measured, and the page of it.
//!
//! [`new_street`] shows a network that is there zero-shot on a street it has never seen, and what learning there from images and motion adds.
//! [`from_scratch`] trains a small network on simulated streets and measures it on another. The caller simulates the drives, runs the
//! trainer and the network, and can stop between two frames.

pub mod from_scratch;
mod measure;
pub mod new_street;
mod settings;
mod shown_prediction;

pub use self::measure::measure;
pub use self::settings::{DemoFolder, DemoSettings};
pub use self::shown_prediction::ShownPrediction;
