//! The camera's motion between two frames, from the vehicle's.

use super::frame::Frame;
use crate::{MotionModel, VehicleMotion};
use deepfusion_geometry::Se3;
use deepfusion_motion::Signal;

/// The camera's motion between a target frame and one of its sources.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct EgoMotion {
    /// Time between the two, in seconds, positive.
    pub dt_s: f64,
    /// Length of the camera's translation, in metres.
    pub distance_m: f64,
    /// Standard deviation of that length, in metres, if the speeds have standard deviations. Their errors are assumed to be fully
    /// correlated between the two frames, as in a smoothed track.
    pub distance_sigma_m: Option<f64>,
    /// The vehicle's mean speed over that time, in m/s, positive also in reverse.
    pub speed_mps: f64,
    /// Transforms points from the target's camera frame to the source's, in metres. When driving forward, its z
    /// translation is negative for the frame after the target and positive for the one before. `None` if turns were neither
    /// measured nor estimated from the images: then only lengths may be used.
    pub source_from_target: Option<Se3>,
}

/// A GPS receiver's measurements other than speed, on the frames' clock.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Receiver {
    /// Rate of turn of the course over ground while the vehicle moved, in rad/s, positive to the left. It is smoothed over about
    /// a second: enough for the offset of two clocks, not for a camera's turn between two frames.
    pub course_rate_radps: Option<Signal>,
    /// Standard deviation of the speeds, in m/s; also from other logs that have one.
    pub speed_sigma_mps: Option<Signal>,
}

/// The vehicle's track and the camera's mount on it, from [`Dataset::ego`](crate::Dataset::ego).
#[derive(Debug, Clone, Copy)]
pub struct Ego<'a> {
    /// The vehicle's motion, on the frames' clock.
    pub(crate) track: &'a MotionModel,
    /// Whether its turns are known: measured, or estimated from the images.
    pub(crate) yaw_known: bool,
    /// Transforms points from the vehicle (x forward, y left, z up) to the camera, in metres.
    pub cam_from_vehicle: Se3,
    /// Standard deviation of the speeds, in m/s, if known.
    pub(crate) speed_sigma_mps: Option<&'a Signal>,
    /// Whether the body's known roll and pitch are applied to the camera.
    pub(crate) rolls_and_pitches: bool,
}

/// Why the motion between two frames is unknown.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[non_exhaustive]
pub enum NoMotion {
    /// Their time stamps do not increase with their numbers.
    Time,
    /// No speed was measured around their times.
    Speed,
}

impl Ego<'_> {
    /// Whether its yaw is known: measured, or estimated from the images.
    #[must_use]
    pub fn yaw_known(&self) -> bool {
        self.yaw_known
    }

    /// The same without roll and pitch, for estimating these from the images.
    #[must_use]
    pub fn level(self) -> Self {
        Self {
            rolls_and_pitches: false,
            ..self
        }
    }

    /// The vehicle's motion between two times, in seconds; `None` if no speed was measured.
    #[must_use]
    pub fn vehicle_motion(&self, from_s: f64, to_s: f64) -> Option<VehicleMotion> {
        let motion = self.track.motion(from_s, to_s)?;
        Some(if self.rolls_and_pitches {
            motion
        } else {
            motion.level()
        })
    }

    /// The camera's motion between two frames, given by index in either order of time.
    ///
    /// # Errors
    /// The reason if it is unknown.
    ///
    /// # Panics
    /// If there is no frame with one of the indices.
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
            // Without a yaw rate, the track's is 0, and this is the distance travelled by the vehicle itself.
            distance_m: earlier_from_later.translation().norm(),
            distance_sigma_m: self
                .speed_sigma_mps
                .and_then(|sigma| Some(sigma.at(0.5 * (from_s + to_s))? * dt_s))
                // A NaN in a log means the same as an empty cell.
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
