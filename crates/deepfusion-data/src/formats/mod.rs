//! Recordings of each layout as [`Dataset`](crate::Dataset)s: one module a layout, told apart by `layout`.
//!
//! Each layout makes [`DatasetParts`](crate::DatasetParts) and a [`Recording`](crate::Recording) of what it finds. All but
//! bags and KITTI raw share one: `plain`; those with poses get their speeds from `pose_track`.

mod bag;
mod comma;
mod files;
mod folder;
mod found_instead;
mod inspect;
pub mod kitti;
mod kitti360;
mod kitti_odometry;
mod layout;
mod neighbours;
mod nuscenes;
mod plain;
mod pose_track;
mod poses;
mod rgbd;
mod video;

pub(crate) use bag::Change;
pub use bag::{DopplerEgo, ego_velocity, ground_radial, write_bag_config};
pub use inspect::{inspect, inspect_with};
