//! Finds objects that stand on the ground: from a depth image to boxes in metres, tracked over time.
//!
//! # Conventions
//! Camera axes: x right, y down, z forward; depth is camera z in metres, 0 = none. Ground axes: right, forward, height. Units are metres,
//! seconds and radians.

mod angle;
mod box_fit;
mod clusters;
mod collision;
mod columns;
mod confidence;
mod config;
mod consensus;
mod detect;
mod edges;
mod error;
mod free_space;
mod ground;
mod ground_box;
mod instances;
mod lanes;
mod obstacles;
mod outermost;
mod parking;
mod perception;
mod rays;
mod rows;
mod scoring;
mod seams;
mod silhouette;
mod split;
mod target;
mod tracking;
mod working_depth;

pub use clusters::Run;
pub use collision::{Collision, VehicleShape, time_to_collision};
pub use confidence::{ConfidenceModel, Evidence, MOST_ERROR, Reliability};
pub use config::PerceptionConfig;
pub use detect::{Detection, detect};
pub use edges::{flying_pixels, without_flying_pixels};
pub use error::{Error, ExpectedSetting, Result};
pub use free_space::{Cell, FreeSpace};
pub use ground::Ground;
pub use ground_box::GroundBox;
pub use instances::{Instance, Kind};
pub use obstacles::Obstacles;
pub use perception::{Perception, Stamp, Surroundings};
pub use rays::Rays;
pub use scoring::{Label, Matched, RangeScore, Scorer, ScoringRules, TargetScore};
pub use target::Target;
pub use working_depth::{scale_bounds, working_depth};
