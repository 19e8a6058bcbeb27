//! ROS bags with a camera and a vehicle's sensors, such as UMAD's.
//!
//! The way of a bag: `source` → `topics` → `sensors` and `index` → `open`. `source` is its reader, whatever is a
//! [`deepfusion_rosbag::MessageSource`]. `topics` says which is which, by message type; `sensors` makes speed, steering and IMU a motion;
//! `index` says when images and scans were taken, and by its messages' `readings` what the vehicle said. `open` puts these together with
//! the `camera` to a `recording` (a [`crate::Recording`]). That reads an `image`, of a `video` stream a frame, or of its `scans` a `scan`,
//! when it is asked for, with the points that its `dynamic` topic lists. Where the sensors are its `frames` say, as `mounts`. What a bag cannot say stands in a file beside it: `config`, which
//! `write_config` writes.

mod camera;
mod can;
mod can_config;
mod commands;
mod config;
mod doppler;
mod dynamic;
mod fixes;
mod frames;
mod image;
mod index;
mod inspect;
mod mounts;
mod odometry_poses;
mod open;
mod packet;
mod point_times;
mod profile;
mod readings;
mod recording;
mod scan;
mod scans;
mod sensors;
mod source;
mod streams;
mod topics;
mod video;
mod world_axes;
mod write_config;

pub(crate) use config::says_simulated;
pub use doppler::{DopplerEgo, ego_velocity, ground_radial};
pub(crate) use frames::Change;
pub(crate) use inspect::without_images;
pub(crate) use open::{open, open_bag};
pub(crate) use source::{bags_in, is_bag};
pub use write_config::write_bag_config;
