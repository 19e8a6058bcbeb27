//! Tracking: associates the boxes of a frame with those of the previous frame, and estimates their velocity over ground.

mod kalman;
mod measurement;
mod track;
mod tracker;

pub(crate) use tracker::{FrameContext, Tracker};
