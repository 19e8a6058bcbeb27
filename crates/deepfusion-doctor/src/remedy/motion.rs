//! What to do about the vehicle's speeds and turns.

use std::fmt;

/// What to do about the vehicle's speeds and turns.
#[derive(Debug, Clone, Copy, PartialEq)]
#[non_exhaustive]
pub enum MotionRemedy {
    /// Speeds in a unit that is known.
    DivideSpeeds {
        /// The unit.
        unit: &'static str,
    },
    /// Speeds that the road contradicts.
    SpeedOrFocalLength,
    /// Speeds that poses contradict.
    SpeedFactor,
    /// Speeds that a LiDAR contradicts.
    SpeedOrSign,
    /// A LiDAR that drives to the side.
    LidarYaw,
    /// A LiDAR that drives up or down.
    LidarPitch,
    /// Dynamic points that do not move.
    DynamicTopic,
    /// Points that move and are not dynamic.
    RadialVelocities,
    /// Turns that are not as far as the steering says.
    Wheelbase {
        /// What to multiply it by.
        factor: f64,
    },
    /// Turns of the wrong sign.
    Mirror,
    /// Turns of another drive.
    CompareTimes,
    /// Turns by another angle.
    FocalLength {
        /// What to multiply it by.
        factor: f64,
    },
}

impl fmt::Display for MotionRemedy {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::DivideSpeeds { unit } => write!(
                f,
                "divide the speeds: they seem to be in {unit} (speed_unit says so for tables and bare numbers)"
            ),
            Self::SpeedOrFocalLength => f.write_str(
                "see the speed signal's unit and factor, and the camera's focal length",
            ),
            Self::SpeedFactor => f.write_str(
                "see the speed signal's unit and factor (km/h is 3.6, a worn tyre 1.02)",
            ),
            Self::SpeedOrSign => f.write_str(
                "see the speed signal's unit and factor (km/h is 3.6), and lidar.receding for the sign of the radial velocities",
            ),
            Self::LidarYaw => f.write_str(
                "correct the yaw of cam_from_lidar or of cam_from_vehicle by that angle",
            ),
            Self::LidarPitch => f.write_str(
                "correct the pitch of cam_from_lidar or of cam_from_vehicle by that angle",
            ),
            Self::DynamicTopic => f.write_str(
                "topics.dynamic names the topic; its points must be the LiDAR's, in its axes and at its times; lidar.moving_mps may be too high",
            ),
            Self::RadialVelocities => f.write_str(
                "see lidar.over_ground and lidar.velocity_field; lidar.moving_mps may be lower than the driver's threshold",
            ),
            Self::Wheelbase { factor } => write!(
                f,
                "multiply vehicle.wheelbase_m by {factor:.2}, or vehicle.steering_ratio if that is the wrong one"
            ),
            Self::Mirror => f.write_str(
                "mirror the images back, or negate the yaw rate (positive is to the left, z up)",
            ),
            Self::CompareTimes => f.write_str(
                "compare the time stamps and the yaw rate's unit (rad/s) and axis (z up)",
            ),
            Self::FocalLength { factor } => write!(
                f,
                "calibrate at the size of these images; fx and fy times {factor:.2} would fit"
            ),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_to_multiply_by_is_said() {
        for (remedy, said) in [
            (
                MotionRemedy::DivideSpeeds { unit: "km/h" },
                "divide the speeds: they seem to be in km/h (speed_unit says so for tables and bare numbers)",
            ),
            (
                MotionRemedy::Wheelbase { factor: 0.6585 },
                "multiply vehicle.wheelbase_m by 0.66, or vehicle.steering_ratio if that is the wrong one",
            ),
            (
                MotionRemedy::FocalLength { factor: 0.8 },
                "calibrate at the size of these images; fx and fy times 0.80 would fit",
            ),
        ] {
            assert_eq!(remedy.to_string(), said);
        }
    }
}
