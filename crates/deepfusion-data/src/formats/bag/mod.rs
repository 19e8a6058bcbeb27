//! ROS bags with a camera and a vehicle's sensors, such as UMAD's.
//!
//! How a bag is opened: `source` → `topics` → `index` → `sensors` → `open`.
//!
//! - `source` opens its reader, a [`deepfusion_rosbag::MessageSource`].
//! - `topics` assigns topics to roles, by message type.
//! - `index` collects the times of images and scans, and the vehicle's measurements from its messages (`readings`).
//! - `sensors` computes the motion from speed, steering and IMU.
//! - `mounts` locates the sensors, with the transforms in `frames`.
//! - `open` combines these with the `camera` into a `recording` (a [`crate::Recording`]), which reads an `image`, a frame of a `video`
//!   stream, or one of its `scans` on request; a `scan` comes with the points listed by the `dynamic` topic.
//! - `config` is the file beside a bag, for what the bag does not contain; `write_config` writes it.

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

pub(crate) use config::marked_as_simulated;
pub use doppler::{DopplerEgo, ego_velocity, ground_radial};
pub(crate) use frames::Change;
pub(crate) use inspect::without_images;
pub(crate) use open::{open, open_bag};
pub(crate) use source::{bags_in, is_bag};
pub use write_config::write_bag_config;
