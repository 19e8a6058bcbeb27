//! Bags as ROS vehicles record them: the sensors' places by `/tf_static` and `/tf`, speeds by satellite positions, several cameras,
//! and no file beside them.

mod common;
mod mounts;
mod reference_drive;
mod topics;
mod written_file;
