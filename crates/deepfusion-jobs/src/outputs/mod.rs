//! What is written for an image: its depth in the requested forms, drawings of 3D targets, and the sidecar that records how they were made.
//!
//! [`DepthOutput`] and [`TargetOutput`] are the forms. [`DepthWriter`] writes those of one image with its sidecar, without waiting for the
//! disk ([`crate::bulk`] waits for many at a time). [`draw`] makes the pictures and clouds of a frame's targets; [`TargetWriter`] writes
//! them.

mod depth;
mod earlier;
mod existing;
mod features;
mod target_writer;
mod targets;
mod writer;

pub use depth::{CloudLimits, DepthOutput, DepthOutputs};
pub use existing::{require_unwritten, without_outputs};
pub use target_writer::TargetWriter;
pub use targets::{Drawing, TargetOutput, TargetScene, draw};
pub use writer::{DepthWriter, SeenDepth};
