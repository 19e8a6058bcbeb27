//! ROS bags with a camera and a vehicle's sensors, such as UMAD's.
//!
//! The way of a bag: `source` (its reader: whatever is a [`deepfusion_rosbag::MessageSource`]) → `topics` (which is which, by message type) → `sensors` (speed, steering and IMU as a motion) and
//! `index` (when images and scans were taken) → `open`, which puts these together with the `camera` to a `recording` (a [`crate::Recording`]). That reads an `image`, or
//! of its `scans` a `scan`, when it is asked for, with the points that its `dynamic` topic lists. What a bag cannot say (where the sensors are) stands in a file beside it: `config`.

mod camera;
mod can;
mod can_config;
mod config;
mod doppler;
mod dynamic;
mod image;
mod index;
mod inspect;
mod open;
mod profile;
mod recording;
mod scan;
mod scans;
mod sensors;
mod source;
mod streams;
mod topics;

pub use doppler::{DopplerEgo, ego_velocity, ground_radial};
pub(crate) use inspect::without_images;
pub(crate) use open::{open, open_bag};
pub(crate) use source::{bags_in, is_bag};
