//! Tests of motion from sensors.

#![allow(
    clippy::unwrap_used,
    clippy::expect_used,
    reason = "a test's panic is its message"
)]

mod can;
mod identify;
mod identify_simulated;
mod recordings;
mod scale_monitor;
mod scene_scale;
mod sensors;
mod support;
mod time_offset;
