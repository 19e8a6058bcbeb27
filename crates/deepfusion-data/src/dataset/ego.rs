//! The camera's motion between two frames, from the car's.

use super::frame::Frame;
use crate::{MotionModel, VehicleMotion};
use deepfusion_geometry::Se3;
use deepfusion_motion::Signal;

/// How the camera moved between a target frame and one of its sources.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct EgoMotion {
    /// Time between the two, in seconds, positive.
    pub dt_s: f64,
    /// Length of the camera's translation, in metres.
    pub distance_m: f64,
    /// Standard deviation of that length, in metres, where the speeds say how sure they are. Their errors are taken to be the same
    /// all the way from one frame to the other, as those of a smoothed track are.
    pub distance_sigma_m: Option<f64>,
    /// The car's mean speed over that time, in m/s, positive also when reversing.
    pub speed_mps: f64,
    /// A point of the target's camera frame in the source's. Driving ahead, its z is negative for the
    /// frame after the target and positive for the one before. `None` where neither a sensor nor, where
    /// they were asked, the images know how the car turned: then only lengths may be used.
    pub source_from_target: Option<Se3>,
}

/// What a satellite receiver's track says beside the speeds, on the frames' clock.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Receiver {
    /// How the course over ground turned where the vehicle moved, in rad/s, positive to the left. It is spread over a second or
    /// so: enough for the offset of two clocks, not for a camera's turn between two frames.
    pub course_rate_radps: Option<Signal>,
    /// Standard deviation of the speeds, in m/s; of other logs that say how sure they are, too.
    pub speed_sigma_mps: Option<Signal>,
}

/// The car's track and the camera's place on the car: [`Dataset::ego`](crate::Dataset::ego).
#[derive(Debug, Clone, Copy)]
pub struct Ego<'a> {
    /// How the vehicle moved, on the frames' clock.
    pub(crate) track: &'a MotionModel,
    /// Whether its turns are known: measured, or taken from the images.
    pub(crate) yaw_known: bool,
    /// A point of the vehicle (x forward, y left, z up, metres) in the camera.
    pub cam_from_vehicle: Se3,
    /// How sure the speeds are, where that is known.
    pub(crate) speed_sigma_mps: Option<&'a Signal>,
    /// Whether the body's roll and pitch, where they are known, turn the camera.
    pub(crate) rolls_and_pitches: bool,
}

/// Why the motion between two frames is unknown.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[non_exhaustive]
pub enum NoMotion {
    /// Their time stamps do not increase with their numbers.
    Time,
    /// No speed was measured about their time.
    Speed,
}

impl Ego<'_> {
    /// Whether its turns to the side are known: measured, or taken from the images.
    #[must_use]
    pub fn yaw_known(&self) -> bool {
        self.yaw_known
    }

    /// The same on a body without roll and pitch: for what measures them in the pictures.
    #[must_use]
    pub fn level(self) -> Self {
        Self {
            rolls_and_pitches: false,
            ..self
        }
    }

    /// What the vehicle did between two times, in seconds; `None` where no speed was measured.
    #[must_use]
    pub fn vehicle_motion(&self, from_s: f64, to_s: f64) -> Option<VehicleMotion> {
        let motion = self.track.motion(from_s, to_s)?;
        Some(if self.rolls_and_pitches {
            motion
        } else {
            motion.level()
        })
    }

    /// The camera's motion between two frames given by index, in either order of time.
    ///
    /// # Errors
    /// Why it is unknown.
    ///
    /// # Panics
    /// If there is no frame of such an index.
    pub fn between(
        &self,
        frames: &[Frame],
        target: usize,
        source: usize,
    ) -> std::result::Result<EgoMotion, NoMotion> {
        let (earlier, later) = (target.min(source), target.max(source));
        let (Some(from_s), Some(to_s)) = (frames[earlier].time_s, frames[later].time_s) else {
            return Err(NoMotion::Time);
        };
        if to_s <= from_s {
            return Err(NoMotion::Time);
        }
        let vehicle = self.vehicle_motion(from_s, to_s).ok_or(NoMotion::Speed)?;
        let earlier_from_later = vehicle.camera0_from_camera1(&self.cam_from_vehicle);
        let dt_s = to_s - from_s;
        Ok(EgoMotion {
            dt_s,
            // Without a yaw rate the track's is 0: this is then the way the vehicle itself went.
            distance_m: earlier_from_later.translation().norm(),
            distance_sigma_m: self
                .speed_sigma_mps
                .and_then(|sigma| Some(sigma.at(0.5 * (from_s + to_s))? * dt_s))
                // A log's own NaN says no more than an empty cell.
                .filter(|sigma_m| sigma_m.is_finite()),
            speed_mps: vehicle.distance_m.abs() / dt_s,
            source_from_target: self.yaw_known.then(|| {
                if source == earlier {
                    earlier_from_later
                } else {
                    earlier_from_later.inverse()
                }
            }),
        })
    }
}
