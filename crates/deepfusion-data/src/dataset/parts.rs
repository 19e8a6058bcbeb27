//! Those parts of a data set that are plain values.

use super::camera::Camera;
use super::frame::Frame;
use crate::{MotionModel, VehicleTrack};
use deepfusion_geometry::{Intrinsics, Se3};

/// The parts of a [`Dataset`](crate::Dataset) that are plain values, which every layout has.
#[derive(Debug, Clone)]
pub struct DatasetParts {
    /// The drive's name.
    pub name: String,
    /// The drive's name in split files; `<date>/<drive>` for KITTI raw.
    pub split_name: String,
    /// The camera that took the images.
    pub camera: Camera,
    /// All frames, ordered by number.
    pub frames: Vec<Frame>,
    /// Intrinsics of the images returned by [`Recording::load_image`](crate::Recording::load_image), in pixels.
    pub intrinsics: Intrinsics,
    /// Transforms points from the vehicle (x forward, y left, z up, origin where speed and yaw rate are measured) to the
    /// camera, in metres; `None` if the layout should have this transform but it is missing.
    pub cam_from_vehicle: Option<Se3>,
    /// The vehicle's speed and yaw rate, if the drive has them.
    pub track: Option<MotionModel>,
    /// Whether the track's yaw rates were measured. If not, they are 0 and meaningless.
    pub yaw_known: bool,
    /// Origin of the times in seconds, in nanoseconds on the vehicle's clock: since 1970, or since that clock's own start.
    pub origin_ns: Option<i64>,
    /// How far the camera's clock is ahead of the vehicle's, in seconds; already subtracted from the images' times.
    pub camera_ahead_s: f64,
    /// The kind of drive, such as `garage`; an evaluation has a row for each.
    pub scenario: Option<String>,
}

impl DatasetParts {
    /// The parts of a drive of which only frames, times and speeds are known: the camera looks straight ahead from the vehicle's origin,
    /// and turns are unknown.
    #[must_use]
    pub fn of_frames(name: &str, frames: Vec<Frame>, intrinsics: Intrinsics) -> Self {
        let samples = frames.iter();
        let samples = samples.filter_map(|frame| Some((frame.time_s?, frame.speed_mps?, 0.0)));
        let track = VehicleTrack::new(&samples.collect::<Vec<_>>());
        Self {
            name: name.to_owned(),
            split_name: name.to_owned(),
            camera: Camera::Left,
            frames,
            intrinsics,
            cam_from_vehicle: Some(cam_from_vehicle_ahead()),
            track: Some(track.into()),
            yaw_known: false,
            origin_ns: None,
            camera_ahead_s: 0.0,
            scenario: None,
        }
    }
}

/// The transform from the vehicle (x forward, y left, z up) to a camera (x right, y down, z forward) at its origin.
fn cam_from_vehicle_ahead() -> Se3 {
    Se3::from_quaternion([0.5, 0.5, -0.5, 0.5], Se3::identity().translation())
}
