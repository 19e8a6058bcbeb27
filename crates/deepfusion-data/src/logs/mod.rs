//! Tables and tracks beside the images: times, speeds, turns.
//!
//! `table` and `gps_log` read files, `clock` and `date_time` their times; `speed_log` makes a vehicle's motion of them (with
//! `vehicle_log` where there is an inertial unit), and `frame_times` says when the images were taken.

pub(crate) mod clock;
pub(crate) mod date_time;
pub(crate) mod frame_times;
mod gps_log;
pub(crate) mod samples;
pub(crate) mod speed_log;
mod table;
mod times;
pub(crate) mod vehicle_log;
