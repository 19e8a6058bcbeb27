//! Training runs around the trainer: what they start and learn from, their plan, their logs and pictures, and adaptation and ablation,
//! which build on them.

pub mod ablation;
pub mod adaptation;
mod asked_recordings;
mod event_line;
mod other_meaning;
mod plan;
mod pose_unit;
pub mod resume;
mod run_lock;
mod run_log;
mod start;
mod start_request;
mod time_estimate;

pub use asked_recordings::AskedRecordings;
pub use event_line::event_line;
pub use other_meaning::OtherMeaning;
pub use plan::{RunLength, TrainingPlan, leaves_turns_unused};
pub use run_lock::RunLock;
pub use run_log::RunLog;
pub use start::{SettingsOfMean, Start, StartReport};
pub use start_request::StartRequest;
pub use time_estimate::{OtherSetting, Pace, TimeEstimate};
