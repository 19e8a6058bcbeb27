//! Training runs around the trainer: what they start from, what they leave to be looked at, and the two that train more than once.

pub mod ablation;
pub mod adaptation;
pub mod resume;
mod run_log;
mod start;
mod time_estimate;

pub use run_log::RunLog;
pub use start::{Began, SettingsOfMean, Start};
pub use time_estimate::{Choice, Pace, TimeEstimate};
