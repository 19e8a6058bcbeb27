//! Training: losses, samples, runs.

#![allow(
    clippy::unwrap_used,
    clippy::expect_used,
    reason = "a test's panic is its message"
)]

mod affine;
mod auto_turns;
mod broken_images;
mod checkpoints;
mod configuration_page;
mod depth;
mod explained;
mod joint;
mod learned_camera;
mod losses;
mod no_yaw_rate;
mod presets;
mod recipes;
mod rgbd;
mod simulated;
mod stereo;
mod support;
mod trainer;
mod video_sizes;
mod whole_step;
mod without_pose_net;
mod workers;
