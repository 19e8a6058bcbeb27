//! Training runs around the trainer: what they start from, what they leave to be looked at, and the two that train more than once.

pub mod ablation;
pub mod adaptation;
mod run_log;
mod start;

pub use run_log::RunLog;
pub use start::{Began, Start};
