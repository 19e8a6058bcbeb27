//! The JSON that stands beside predictions and targets: the same structs for who writes it and who reads it.
//!
//! | File | Struct |
//! |---|---|
//! | `NAME.json`, the sidecar of a prediction | [`Sidecar`]; what can be shown of any program's is its [`PredictionRecord`] |
//! | `NAME_targets.json`, and each line of `targets.jsonl` | [`FrameRecord`] |
//!
//! Field names and their order are fixed: scripts rely on them. A field that is not in a file takes its default, where the struct
//! says so; fields that are not known are ignored.

mod frame;
mod made_with;
mod marks;
mod prediction;

pub use deepfusion_eval::compare::MetricScale;
pub use deepfusion_motion::{ScaleReading, ScaleState};
pub use deepfusion_perception::Target;
pub use frame::{FrameRecord, GroundPlane};
pub use made_with::{Difference, MadeWith, same_number};
pub use marks::{FileMark, LiveMark, ScaleRecord};
pub use prediction::{PredictionRecord, Sidecar};
