//! Recordings of each layout as [`Dataset`](crate::Dataset)s: one module a layout, told apart by `layout`.
//!
//! Each layout makes [`DatasetParts`](crate::DatasetParts) and a [`Recording`](crate::Recording) of what it finds. Folders, videos,
//! comma2k19 segments and RGB-D folders share one: `plain`.

mod bag;
mod comma;
mod files;
mod folder;
mod inspect;
pub mod kitti;
mod layout;
mod plain;
mod rgbd;
mod video;

pub use bag::{DopplerEgo, ego_velocity, ground_radial};
pub use inspect::{inspect, inspect_with};
