//! Bags as recorded by ROS vehicles: mounts from `/tf_static` and `/tf`, speeds from GPS positions, several cameras,
//! and no file beside the bag.

mod common;
mod mounts;
mod reference_drive;
mod topics;
mod written_file;
