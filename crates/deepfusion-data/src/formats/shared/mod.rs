//! Code shared by several layouts: listing files, poses and the motion computed from them, and the recording used by all layouts except
//! bags and KITTI raw.

pub(super) mod files;
pub(super) mod frames_place;
pub(super) mod plain;
pub(super) mod pose_track;
pub(super) mod poses;
