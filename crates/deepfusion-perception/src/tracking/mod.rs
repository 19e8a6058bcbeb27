//! Targets over time: which box of this frame is which of the last, and how fast it moves over ground.

mod kalman;
mod measurement;
mod track;
mod tracker;

pub(crate) use tracker::{Now, Tracker};
