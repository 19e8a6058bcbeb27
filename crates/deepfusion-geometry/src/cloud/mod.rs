//! Point clouds from depth maps, and as PLY, PCD and binary scans of KITTI and nuScenes.
//!
//! Points are in metres, in the frame the cloud was made in: the camera's (x right, y down, z forward)
//! for [`PointCloud::from_depth`], the sensor's (x forward, y left, z up) for a velodyne scan.

mod error;
mod kitti_bin;
mod pcd;
mod ply;
mod point_cloud;

pub use deepfusion_fs::FileError;

pub use error::{Error, PlyProblem, Result, SizeProblem};
pub use point_cloud::PointCloud;
