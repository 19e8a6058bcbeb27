//! Reads tables and tracks beside the images: times, speeds, turns.
//!
//! `table` reads this program's own tables, and `clock` and `date_time` their times. `speed_log` computes a vehicle's motion from them or
//! from any other log that `deepfusion-logs` reads, with `vehicle_log` for an inertial unit. `frame_times` reads the times of the images.

pub(crate) mod clock;
pub(crate) mod date_time;
pub(crate) mod frame_times;
pub(crate) mod samples;
pub(crate) mod speed_log;
mod table;
mod times;
pub(crate) mod vehicle_log;
