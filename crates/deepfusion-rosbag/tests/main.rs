//! ROS 1 bags, compared with what the `rosbags` package reads.

#![allow(
    clippy::unwrap_used,
    clippy::expect_used,
    reason = "a test's panic is its message"
)]

mod bag_sets;
mod common;
mod damaged_bags;
mod frames;
mod image_encodings;
mod reference_bags;
mod video;
mod written;
mod written_bags;
