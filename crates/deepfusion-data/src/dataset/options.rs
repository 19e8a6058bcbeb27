//! What a caller may say when a recording is opened.

use super::camera::Cameras;
use super::split::Split;

/// How to open a recording.
#[derive(Debug, Clone, Default)]
pub struct OpenOptions {
    /// Which cameras.
    pub camera: Cameras,
    /// Only these frames are selected; their neighbours still serve as sources.
    pub split: Option<Split>,
    /// fx, fy, cx, cy in pixels of an undistorted image, instead of the recording's own. Not for KITTI
    /// raw, which brings its calibration and refuses it.
    pub intrinsics: Option<[f64; 4]>,
    /// How far the clock of camera and LiDAR is ahead of the vehicle's, in seconds, instead of what the recording's own
    /// file says (`clock.camera_ahead_s`). It is taken off the images' times, once, when a recording is opened: every time of
    /// a [`crate::Dataset`] is one of the vehicle's clock.
    pub camera_ahead_s: Option<f64>,
}
