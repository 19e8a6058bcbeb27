//! A camera's calibration, and the correction of its lens' distortion.

mod calibration;
mod find;
mod lens;
mod numbers;
mod source;
mod write;
mod yaml;

pub use calibration::CameraCalibration;
pub use find::calibration_near;
pub(crate) use find::{Pictures, find_camera};
pub use lens::Lens;
pub use source::CalibrationSource;
pub use write::camera_info_yaml;
pub(crate) use yaml::FISHEYE;
