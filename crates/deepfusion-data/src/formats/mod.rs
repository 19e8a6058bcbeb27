//! Recordings of each layout as [`Dataset`](crate::Dataset)s: one module a layout; `layout` tells them apart.
//!
//! Each layout makes [`DatasetParts`](crate::DatasetParts) and a [`Recording`](crate::Recording) of what it finds. All but
//! bags and KITTI raw share one, `shared::plain`; those with poses get their speeds from `shared::pose_track`.

mod bag;
mod comma;
mod folder;
mod inspect;
pub mod kitti;
mod kitti360;
mod kitti_odometry;
mod layout;
mod nuscenes;
mod rgbd;
mod shared;
mod video;

pub(crate) use bag::Change;
pub use bag::{DopplerEgo, ego_velocity, ground_radial, write_bag_config};
pub use inspect::{inspect, inspect_with};
