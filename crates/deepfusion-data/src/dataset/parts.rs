//! The plain values of a data set.

use super::camera::Camera;
use super::frame::Frame;
use crate::{MotionModel, VehicleTrack};
use deepfusion_geometry::{Intrinsics, Se3};

/// What every layout has: the parts of a [`Dataset`](crate::Dataset) that are plain values.
#[derive(Debug, Clone)]
pub struct DatasetParts {
    /// The drive's name.
    pub name: String,
    /// Its name in split files; KITTI raw's is `<date>/<drive>`.
    pub split_name: String,
    /// The camera whose images these are.
    pub camera: Camera,
    /// All frames, by number.
    pub frames: Vec<Frame>,
    /// Of the images as [`Recording::load_image`](crate::Recording::load_image) gives them.
    pub intrinsics: Intrinsics,
    /// A point of the vehicle (x forward, y left, z up, where speed and yaw rate are measured) in the
    /// camera; `None` where the layout has to know it and does not.
    pub cam_from_vehicle: Option<Se3>,
    /// The car's speed and yaw rate, where the drive has them.
    pub track: Option<MotionModel>,
    /// Whether the track's yaw rates were measured. Where not, they are 0 and mean nothing.
    pub yaw_known: bool,
    /// Nanoseconds from which seconds are counted, on the vehicle's clock: since 1970 or whatever it starts at.
    pub origin_ns: Option<i64>,
    /// What was taken off the images' times, in seconds: how far the camera's clock is ahead of the vehicle's.
    pub camera_ahead_s: f64,
    /// The kind of drive, such as `garage`, for a row each in an evaluation.
    pub scenario: Option<String>,
}

impl DatasetParts {
    /// A drive of which no more is known than its frames, their times and speeds: its camera looks ahead, at the vehicle's own place, and nothing
    /// says how it turned.
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
            cam_from_vehicle: Some(looks_ahead()),
            track: Some(track.into()),
            yaw_known: false,
            origin_ns: None,
            camera_ahead_s: 0.0,
            scenario: None,
        }
    }
}

/// The vehicle's axes (x ahead, y to the left, z up) in a camera's (x to the right, y down, z ahead) at its origin.
fn looks_ahead() -> Se3 {
    Se3::from_quaternion([0.5, 0.5, -0.5, 0.5], Se3::identity().translation())
}
