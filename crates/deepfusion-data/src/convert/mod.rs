//! A recording of any layout written as another: KITTI raw, or a ROS 1 bag.
//!
//! What is written is what a [`Dataset`](crate::Dataset) gives: images freed of their lens' distortion, their times, the
//! camera, its place on the vehicle, speeds, turns, roll and pitch, and the measured depth as points in the camera's place. The
//! other layout then gives the same snippets and the same ground truth. The measured depth alone is written as arrays, or drawn on the images.

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
