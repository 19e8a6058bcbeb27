//! Options for opening a recording.

use super::camera::Cameras;
use super::split::Split;
use super::topic::NamedTopic;
use deepfusion_geometry::{HFOV_DEG, Intrinsics};
use std::path::PathBuf;

/// How to open a recording.
#[derive(Debug, Clone, Default)]
pub struct OpenOptions {
    /// Which cameras to open.
    pub camera: Cameras,
    /// Selects only these frames; their neighbours can still be sources.
    pub split: Option<Split>,
    /// fx, fy, cx, cy in pixels of an undistorted image, instead of the recording's own. An error for layouts with their own
    /// calibration, such as KITTI raw.
    pub intrinsics: Option<[f64; 4]>,
    /// The images' horizontal field of view in degrees, above 1 and below 170: a pinhole camera with square pixels and
    /// a centred principal point ([`Intrinsics::from_hfov`]). [`Self::intrinsics`] takes precedence.
    pub hfov_deg: Option<f64>,
    /// A calibration file of the camera ([`crate::CameraCalibration::read`]), instead of the recording's own. The two options above
    /// take precedence. An error for layouts with their own calibration.
    pub calibration: Option<PathBuf>,
    /// The camera assumed for recordings without a calibration, which are otherwise an error ([`crate::Dataset::camera_assumed`]):
    /// this one at the images' size ([`Intrinsics::centred_at`]).
    pub assumed_camera: Option<Intrinsics>,
    /// How far the clock of camera and LiDAR is ahead of the vehicle's, in seconds, instead of the value in the recording's
    /// file (`clock.camera_ahead_s`). It is subtracted from the images' times when a recording is opened: all times of
    /// a [`crate::Dataset`] are on the vehicle's clock.
    pub camera_ahead_s: Option<f64>,
    /// Topics of bags by role, instead of those named in the file beside a bag or found by type. An error for recordings other
    /// than bags.
    pub topics: Vec<NamedTopic>,
}

impl OpenOptions {
    /// Whether the caller gives a camera.
    #[must_use]
    pub fn gives_camera(&self) -> bool {
        self.intrinsics.is_some() || self.hfov_deg.is_some() || self.calibration.is_some()
    }

    /// fx, fy, cx, cy of the camera given as numbers, for images of this size in pixels; `None` if none is given.
    pub(crate) fn given_camera(&self, size: (u32, u32)) -> Option<[f64; 4]> {
        let by_view = |hfov_deg| numbers_of_hfov(hfov_deg, size);
        self.intrinsics.or_else(|| self.hfov_deg.map(by_view))
    }

    /// fx, fy, cx, cy of the assumed camera for images of this size in pixels, if one is assumed.
    pub(crate) fn assumed_numbers(&self, size: (u32, u32)) -> Option<[f64; 4]> {
        let camera = self.assumed_camera.map(|k| k.centred_at(size));
        camera.map(|k| [k.fx, k.fy, k.cx, k.cy])
    }
}

/// fx, fy, cx, cy of images of this size with a horizontal field of view of `hfov_deg` degrees. An impossible angle gives implausible
/// numbers, which [`crate::CameraCalibration::given`] refuses.
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
