//! Tests of recordings in every layout, valid and damaged.

#![allow(
    clippy::unwrap_used,
    clippy::expect_used,
    reason = "a test's panic is its message"
)]

mod bag_sidecar;
mod camera;
mod clock_and_scale;
mod comma;
mod common;
mod conversion;
mod drives;
mod folders;
mod ground_truth;
mod kitti360;
mod kitti_odometry;
mod lens;
mod motion;
mod moving;
mod nuscenes;
mod recording;
mod rgbd;
mod ros2;
mod ros_frames;
mod simulated;
mod speed_check;
mod video;
mod video_topics;
