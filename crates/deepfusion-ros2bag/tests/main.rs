//! ROS 2 bags.

#![allow(
    clippy::unwrap_used,
    clippy::expect_used,
    reason = "a test's panic is its message"
)]

#[cfg(feature = "ros2-sqlite")]
#[path = "../../deepfusion-rosbag/tests/common/mod.rs"]
mod common;
#[cfg(feature = "ros2-sqlite")]
mod damaged_bags;
#[cfg(feature = "ros2-sqlite")]
mod dataset;
#[cfg(feature = "ros2-sqlite")]
mod reference_bags;
mod without_sqlite;
