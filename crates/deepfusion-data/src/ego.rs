//! The camera's motion between two frames, from the car's.

use crate::snippet::{EgoMotion, NoMotion};
use crate::{Frame, MotionModel, VehicleMotion};
use deepfusion_geometry::Se3;

/// The car's track and the camera's place on the car.
pub(crate) struct Ego<'a> {
    pub(crate) track: &'a MotionModel,
    pub(crate) yaw_known: bool,
    pub(crate) cam_from_vehicle: Se3,
    /// Whether the body's lean, where an inertial unit felt it, turns the camera.
    pub(crate) leans: bool,
}

impl Ego<'_> {
    /// The same on a body that never leans: for what looks in the pictures for how it does.
    pub(crate) fn level(self) -> Self {
        Self {
            leans: false,
            ..self
        }
    }

    /// What the vehicle did between two times, in seconds.
    pub(crate) fn vehicle_motion(&self, from_s: f64, to_s: f64) -> Option<VehicleMotion> {
        let motion = self.track.motion(from_s, to_s)?;
        Some(if self.leans { motion } else { motion.level() })
    }

    /// The camera's motion between two frames given by index, in either order of time.
    pub(crate) fn between(
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
