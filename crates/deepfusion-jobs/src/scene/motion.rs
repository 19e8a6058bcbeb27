//! The camera's motion from frame to frame of a recording.

use std::sync::Arc;
use std::time::Instant;

use deepfusion_data::Dataset;
use deepfusion_geometry::Se3;
use deepfusion_perception::Stamp;
use nalgebra::Vector3;

use crate::Input;

/// When and where a frame was taken, and the vehicle's motion at that time.
#[derive(Debug, Clone, Copy, Default)]
pub struct Motion {
    /// Time and pose; `None` for a frame that stands alone.
    pub stamp: Option<Stamp>,
    /// The vehicle's speed, in m/s.
    pub speed_mps: Option<f64>,
    /// The vehicle's yaw rate, in rad/s, positive to the left.
    pub yaw_rate: f64,
    /// Time since the last frame in seconds, if this frame follows it.
    pub seconds: Option<f64>,
    /// The pose of this frame's camera in the last frame's camera, if this frame follows it.
    pub last_from_this: Option<Se3>,
    /// Whether this frame follows the last one, so that tracks continue.
    pub continues: bool,
    /// Whether this is the first frame, or the last frame belonged to another recording: what was learned from that does not apply.
    pub begins_recording: bool,
    /// The downward direction in the camera's axes, if the mount is known.
    pub down_in_cam: Option<Vector3<f64>>,
    /// The vehicle's forward direction in the camera's axes, if the mount is known.
    pub ahead_in_cam: Option<Vector3<f64>>,
}

/// Cosine of the angle from which on a camera does not look ahead: sixty degrees.
const LOOKS_ASIDE: f64 = 0.5;

impl Motion {
    /// The angle in rad by which the camera looks to the left of straight ahead; 0 if the mount is unknown, `None` if it looks to the side
    /// or back.
    #[must_use]
    pub fn camera_yaw(&self) -> Option<f64> {
        let ahead = self.ahead_in_cam.unwrap_or(Vector3::z());
        let yaw = ahead.x.atan2(ahead.z);
        (yaw.cos() > LOOKS_ASIDE).then_some(yaw)
    }
}

/// Whether a recording contains its camera's motion.
#[must_use]
pub fn motion_known(dataset: &Dataset) -> bool {
    dataset.track().is_some() && dataset.yaw_known()
}

/// The vehicle's yaw rate in rad/s, positive to the left, given its camera's motion in `seconds`; `last_from_this` is the camera's pose in
/// the last frame's camera.
#[must_use]
pub fn yaw_rate(last_from_this: &Se3, seconds: f64) -> f64 {
    // The camera's y axis points down, so a turn to the left is negative around it.
    -last_from_this.axis_angle().y / seconds
}

/// Accumulates the camera's motion over the frames of a recording.
#[derive(Debug, Default)]
pub struct MotionTracker {
    last: Option<(Arc<Dataset>, usize, Se3)>,
    /// The recording of the last frame.
    recording: Option<Arc<Dataset>>,
}

impl MotionTracker {
    /// The motion of the next frame.
    pub fn next(&mut self, input: &Input) -> Motion {
        let Some((dataset, index)) = &input.frame else {
            self.last = None;
            return Motion::default();
        };
        self.of(dataset, *index)
    }

    /// As [`Self::next`], for a recording's frame.
    pub fn of(&mut self, dataset: &Arc<Dataset>, index: usize) -> Motion {
        let frame = &dataset.frames()[index];
        let before = self.recording.replace(Arc::clone(dataset));
        let begins_recording = before.is_none_or(|before| !Arc::ptr_eq(&before, dataset));
        let step = self.last.take().and_then(|(before, last, world_from_cam)| {
            let same = Arc::ptr_eq(&before, dataset) && index > last;
            let motion = same.then(|| dataset.camera_motion(last, index))??;
            let dt = frame.time_s? - dataset.frames()[last].time_s?;
            Some((world_from_cam * motion, motion, dt))
        });
        // A track begins at the first frame of a recording with known motion, and again after a gap; frames within the gap stand alone.
        let begins = motion_known(dataset) && frame.speed_mps.is_some();
        let begun = begins.then(Se3::identity);
        let world_from_cam = step.map(|(pose, ..)| pose).or(begun);
        let stamp = world_from_cam
            .zip(frame.time_s)
            .map(|(world_from_cam, time_s)| Stamp {
                time_s,
                world_from_cam,
            });
        if let Some(stamp) = stamp {
            self.last = Some((dataset.clone(), index, stamp.world_from_cam));
        }
        Motion {
            stamp,
            speed_mps: frame.speed_mps,
            yaw_rate: step.map_or(0.0, |(_, motion, dt)| yaw_rate(&motion, dt)),
            last_from_this: step.map(|(_, motion, _)| motion),
            seconds: step.map(|(.., dt)| dt),
            continues: step.is_some(),
            begins_recording,
            down_in_cam: dataset
                .cam_from_vehicle()
                .map(|cam| -cam.rotate(&Vector3::z())),
            ahead_in_cam: dataset
                .cam_from_vehicle()
                .map(|cam| cam.rotate(&Vector3::x())),
        }
    }
}

/// The motion of a camera that looks straight ahead from a vehicle driving straight. The scale is not monitored: a constant speed given by
/// the user carries no information about the scale.
#[derive(Debug)]
pub struct StraightWay {
    speed_mps: Option<f64>,
    first: Option<Instant>,
}

impl StraightWay {
    /// At a constant speed in m/s: 0 is a camera at rest. With `None`, the motion is unknown.
    #[must_use]
    pub fn new(speed_mps: Option<f64>) -> Self {
        Self {
            speed_mps,
            first: None,
        }
    }

    /// The motion at a frame's arrival.
    pub fn at(&mut self, arrived: Instant) -> Motion {
        let Some(speed) = self.speed_mps else {
            return Motion::default();
        };
        let continues = self.first.is_some();
        let first = *self.first.get_or_insert(arrived);
        let time_s = arrived.duration_since(first).as_secs_f64();
        let place = Vector3::z() * speed * time_s;
        Motion {
            stamp: Some(Stamp {
                time_s,
                world_from_cam: Se3::from_axis_angle(Vector3::zeros(), place),
            }),
            speed_mps: Some(speed),
            continues,
            ..Motion::default()
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::time::Duration;

    #[test]
    fn a_camera_that_looks_back_has_no_yaw() {
        let looking = |x: f64, z: f64| Motion {
            ahead_in_cam: Some(Vector3::new(x, 0.0, z)),
            ..Motion::default()
        };
        assert_eq!(Motion::default().camera_yaw(), Some(0.0));
        let left = looking(0.1, 0.995).camera_yaw().unwrap();
        assert!((left - 0.1).abs() < 0.001, "{left}");
        assert_eq!(looking(0.0, -1.0).camera_yaw(), None);
        assert_eq!(looking(-1.0, 0.1).camera_yaw(), None);
    }

    #[test]
    fn a_given_speed_is_motion_straight_ahead() {
        let mut way = StraightWay::new(Some(8.0));
        let start = Instant::now();
        assert!(!way.at(start).continues);
        let motion = way.at(start + Duration::from_millis(250));
        let stamp = motion.stamp.unwrap();
        assert_eq!(stamp.time_s, 0.25);
        assert_eq!(
            stamp.world_from_cam.translation(),
            Vector3::new(0.0, 0.0, 2.0)
        );
        assert_eq!(motion.speed_mps, Some(8.0));
        assert!(motion.continues);
        let mut nowhere = StraightWay::new(None);
        for _ in 0..2 {
            let unknown = nowhere.at(start);
            assert!(unknown.stamp.is_none() && unknown.speed_mps.is_none() && !unknown.continues);
        }
    }
}
