//! What a caller may say when a recording is opened.

use super::camera::Cameras;
use super::split::Split;
use super::topic::NamedTopic;
use deepfusion_geometry::{HFOV_DEG, Intrinsics};
use std::path::PathBuf;

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
    /// The images' field of view from left to right in degrees, above 1 and below 170: a pinhole camera with square pixels and
    /// the principal point in the middle ([`Intrinsics::from_hfov`]). Where [`Self::intrinsics`] is given too, that holds.
    pub hfov_deg: Option<f64>,
    /// A calibration file of the camera ([`crate::CameraCalibration::read`]), instead of the recording's own. Where one of the two above is given,
    /// too, that holds. Not for layouts that bring their calibration, either.
    pub calibration: Option<PathBuf>,
    /// The camera of recordings of which nothing says it, in place of an error ([`crate::Dataset::camera_assumed`]): this one at
    /// the images' size ([`Intrinsics::centred_at`]).
    pub assumed_camera: Option<Intrinsics>,
    /// How far the clock of camera and LiDAR is ahead of the vehicle's, in seconds, instead of what the recording's own
    /// file says (`clock.camera_ahead_s`). It is taken off the images' times, once, when a recording is opened: every time of
    /// a [`crate::Dataset`] is one of the vehicle's clock.
    pub camera_ahead_s: Option<f64>,
    /// Topics of bags by their role, in place of what the file beside a bag names and of what is found by type. A recording
    /// that is no bag is refused with them.
    pub topics: Vec<NamedTopic>,
}

impl OpenOptions {
    /// Whether the caller says what the camera is.
    #[must_use]
    pub fn gives_camera(&self) -> bool {
        self.intrinsics.is_some() || self.hfov_deg.is_some() || self.calibration.is_some()
    }

    /// fx, fy, cx, cy of the camera that the caller gives in numbers, of images of a size in pixels; `None` where none are given.
    pub(crate) fn given_camera(&self, size: (u32, u32)) -> Option<[f64; 4]> {
        let by_view = |hfov_deg| numbers_of_hfov(hfov_deg, size);
        self.intrinsics.or_else(|| self.hfov_deg.map(by_view))
    }

    /// fx, fy, cx, cy of the camera that is assumed of images of a size in pixels, where one is.
    pub(crate) fn assumed_numbers(&self, size: (u32, u32)) -> Option<[f64; 4]> {
        let camera = self.assumed_camera.map(|k| k.centred_at(size));
        camera.map(|k| [k.fx, k.fy, k.cx, k.cy])
    }
}

/// fx, fy, cx, cy of images of a size that see `hfov_deg` degrees from left to right. An angle that cannot be one gives numbers
/// that are no camera, which [`crate::CameraCalibration::given`] refuses.
pub(crate) fn numbers_of_hfov(hfov_deg: f64, size: (u32, u32)) -> [f64; 4] {
    let (least, most) = HFOV_DEG;
    let k = Intrinsics::from_hfov(hfov_deg, size);
    let focal = if hfov_deg > least && hfov_deg < most {
        k.fx
    } else {
        f64::NAN
    };
    [focal, focal, k.cx, k.cy]
}
