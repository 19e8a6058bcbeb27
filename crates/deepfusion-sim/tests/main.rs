//! Tests of the simulator: its outputs are exact, consistent, and readable by the readers of its formats.

#![allow(
    clippy::unwrap_used,
    clippy::expect_used,
    reason = "a test's panic is its message"
)]

mod consistency;
mod doctor;
mod doctor_faults;
mod endless;
mod kitti_layout;
mod riders;
mod seen_turns;
mod umad_bag;
mod umad_dataset;
mod umad_motion;
mod umad_moving;
mod umad_sensors;
mod unchanged;
mod varied_drives;
mod worlds;
