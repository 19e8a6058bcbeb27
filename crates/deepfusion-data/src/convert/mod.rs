//! Converts a recording of any layout to KITTI raw or a ROS 1 bag.
//!
//! The contents of a [`Dataset`](crate::Dataset) are written: images corrected for lens distortion, their times, the
//! camera, its mount on the vehicle, speeds, yaw rates, roll and pitch, and the measured depth as points relative to the camera. The
//! converted recording gives the same snippets and ground truth. The measured depth can also be written as arrays, or drawn on the images.

mod bag;
mod calendar;
mod ground_truth;
mod kitti;
mod names;
mod overlays;
mod parts;

pub use bag::convert_to_bag;
pub use ground_truth::{VELOCITY, export_gt};
pub use kitti::convert_to_kitti;
pub use names::ground_truth_names;
pub use overlays::write_overlays;
pub use parts::Converted;
