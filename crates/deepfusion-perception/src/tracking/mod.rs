//! Tracking: associates the boxes of this frame with those of the last, and estimates their velocity over ground.

mod kalman;
mod measurement;
mod track;
mod tracker;

pub(crate) use tracker::{FrameContext, Tracker};
