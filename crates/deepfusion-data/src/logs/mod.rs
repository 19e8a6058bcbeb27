//! Tables and tracks beside the images: times, speeds, turns.
//!
//! `table` reads this program's own tables, `clock` and `date_time` their times; `speed_log` makes a vehicle's motion of them or of any other
//! log that `deepfusion-logs` reads (with `vehicle_log` where there is an inertial unit), and `frame_times` says when the images were taken.

pub(crate) mod clock;
pub(crate) mod date_time;
pub(crate) mod frame_times;
pub(crate) mod samples;
pub(crate) mod speed_log;
mod table;
mod times;
pub(crate) mod vehicle_log;
