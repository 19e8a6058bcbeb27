//! What is written of an image: its depth in the forms asked for, 3D targets drawn, and the sidecar that says how it was made.
//!
//! [`DepthOutput`] and [`TargetOutput`] are the forms; [`DepthWriter`] writes those of one image with its sidecar, without waiting for
//! the disk ([`crate::bulk`] does, many at a time); [`draw`] makes the pictures and clouds of a frame's targets.

mod depth;
mod features;
mod is_output;
mod targets;
mod unwritten;
mod writer;

pub use depth::{CloudLimits, DepthOutput, DepthOutputs};
pub use is_output::is_output;
pub use targets::{Drawing, TargetOutput, TargetScene, draw};
pub use unwritten::require_unwritten;
pub use writer::{DepthWriter, SeenDepth};
