//! Reads recordings as [`Dataset`](crate::Dataset)s, with a module for each layout; `layout` recognises the layout.
//!
//! Each layout provides [`DatasetParts`](crate::DatasetParts) and a [`Recording`](crate::Recording). All except bags and KITTI raw use
//! the same one, `shared::plain`; layouts with poses compute their speeds with `shared::pose_track`.

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
