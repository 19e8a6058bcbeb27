//! Reads KITTI raw: `<date>/<date>_drive_<n>_sync/{image_02,image_03,velodyne_points,oxts}`, with the calibration
//! files in `<date>`.

mod calibration;
mod config;
mod fields;
mod layout;
mod moving;
mod oxts;
mod oxts_path;
mod recording;
mod timestamps;
mod tracklets;
mod velodyne;

pub use crate::error::{
    CalibrationProblem, OxtsField, OxtsProblem, TrackletPart, TrackletPlace, TrackletsProblem,
};
pub use crate::truth::GtKind;
pub use calibration::Calibration;
pub(crate) use fields::{Fields, cam_from_cam0};
pub use layout::{Drive, find_drives};
pub(crate) use layout::{drive_around, numbered_files};
pub use oxts::{OxtsPacket, read_oxts};
pub(crate) use recording::{open, optional};
pub use timestamps::TimeStamps;
pub use tracklets::{Tracklet, TrackletPose};
pub use velodyne::{depth_map, velo_point};
