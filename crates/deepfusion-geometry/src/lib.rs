//! Cameras, rigid motions, trajectories, depth maps and point clouds, in plain `f32` / `f64`.
//!
//! # Conventions
//! - Camera frame: x right, y down, z forward. Vehicle frame: x forward, y left, z up.
//! - Depth is camera z in metres, never range. Angles are in radians, times in seconds, speeds in m/s.
//! - Transforms are named `a_from_b`: they transform a point from frame b to frame a.
//! - Pixels have integer centres: the centre of the top-left pixel is (0, 0).

pub mod cloud;
mod depth_map;
mod depth_range;
mod distortion;
mod intrinsics;
mod npy;
mod pose_text;
mod se3;
mod trajectory;

pub use depth_map::DepthMap;
pub use depth_range::DepthRange;
pub use distortion::{Distortion, NoDistortion};
pub use intrinsics::{HFOV_DEG, ImplausibleCamera, Intrinsics};
pub use npy::{NpyHeader, NpyHeaderProblem};
pub use pose_text::{kitti_line, scientific};
pub use se3::Se3;
pub use trajectory::{StampedPose, Trajectory};
