//! KITTI raw as it lies on disk: `<date>/<date>_drive_<n>_sync/{image_02,image_03,velodyne_points,oxts}`
//! with the calibration files in `<date>`.

mod calibration;
mod config;
pub(crate) mod layout;
mod oxts;
mod oxts_path;
mod recording;
mod timestamps;
mod tracklets;
mod velodyne;

pub use calibration::Calibration;
pub use layout::{Drive, find_drives};
pub(crate) use oxts::read_packets;
pub use oxts::{OxtsPacket, read_oxts};
pub(crate) use oxts_path::oxts_paths;
pub(crate) use recording::{KittiRecording, open};
pub use timestamps::TimeStamps;
pub(crate) use timestamps::parse_date_time;
pub use tracklets::{Tracklet, TrackletPose};
pub use velodyne::{GtKind, depth_map, velo_point};
