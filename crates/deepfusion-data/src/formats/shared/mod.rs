//! What several layouts share: files and folders by name, poses and what follows from them, the recording that all but bags and KITTI raw
//! make.

pub(super) mod files;
pub(super) mod frames_place;
pub(super) mod plain;
pub(super) mod pose_track;
pub(super) mod poses;
