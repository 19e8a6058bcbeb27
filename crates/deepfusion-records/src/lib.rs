//! The JSON files beside predictions and targets, as structs that writers and readers share.
//!
//! | File | Struct |
//! |---|---|
//! | `NAME.json`, the sidecar of a prediction | [`Sidecar`]; the part that any program's sidecar has is its [`PredictionRecord`] |
//! | `NAME_targets.json`, and each line of `targets.jsonl` | [`FrameRecord`] |
//!
//! Field names and their order are fixed: scripts rely on them. A missing field takes its default if the struct defines one; unknown fields
//! are ignored.

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
