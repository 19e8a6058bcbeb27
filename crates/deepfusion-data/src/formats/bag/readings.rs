//! The vehicle's speed or steering from a message of any supported type.

use super::config::BagConfig;
use super::odometry_poses::pose_without_twist;
use crate::{ConfigProblem, Result};
use deepfusion_geometry::Se3;
use deepfusion_rosbag::Message;
use deepfusion_rosbag::msg::{
    AckermannDriveStamped, Float32, Float64, Odometry, Twist, TwistStamped,
    TwistWithCovarianceStamped,
};

/// The values in a message with the speed.
pub(super) struct Reading {
    pub(super) speed_mps: f64,
    /// The lateral velocity in a twist, positive to the left, in the vehicle's axes.
    pub(super) across_mps: Option<f64>,
    /// Roll, pitch and yaw rate, in rad/s.
    pub(super) rates: Option<[f64; 3]>,
    /// The frame that the speed refers to.
    pub(super) frame: Option<String>,
    /// `world_from_body` of an odometry message whose twist is 0.
    pub(super) pose: Option<Se3>,
}

impl Reading {
    fn of_twist(twist: &Twist, frame: String) -> Self {
        let turn = &twist.angular;
        Self {
            speed_mps: twist.linear.x,
            across_mps: Some(twist.linear.y),
            rates: Some([turn.x, turn.y, turn.z]),
            frame: Some(frame),
            pose: None,
        }
    }
}

/// The vehicle's forward speed and what else the message contains.
///
/// # Errors
/// [`crate::Error::Bag`]; [`crate::Error::Config`] for a plain number without a unit.
pub(super) fn reading(message: &Message<'_>, config: &BagConfig) -> Result<Reading> {
    if message.is::<TwistStamped>() {
        let twist: TwistStamped = message.decode()?;
        return Ok(Reading::of_twist(&twist.twist, twist.header.frame_id));
    }
    if message.is::<TwistWithCovarianceStamped>() {
        let twist: TwistWithCovarianceStamped = message.decode()?;
        return Ok(Reading::of_twist(&twist.twist.twist, twist.header.frame_id));
    }
    if message.is::<AckermannDriveStamped>() {
        let drive: AckermannDriveStamped = message.decode()?;
        return Ok(Reading {
            speed_mps: f64::from(drive.drive.speed),
            across_mps: None,
            rates: None,
            frame: Some(drive.header.frame_id),
            pose: None,
        });
    }
    if message.is::<Odometry>() {
        let odometry: Odometry = message.decode()?;
        let pose = pose_without_twist(&odometry);
        return Ok(Reading {
            pose,
            ..Reading::of_twist(&odometry.twist.twist, odometry.child_frame_id)
        });
    }
    let value = number(message)?;
    let unit = config.vehicle.speed_unit.ok_or_else(|| {
        config.wrong(ConfigProblem::NoSpeedUnit {
            topic: message.topic().to_owned(),
        })
    })?;
    Ok(Reading {
        speed_mps: value * unit.metres_per_second(),
        across_mps: None,
        rates: None,
        frame: None,
        pose: None,
    })
}

/// The steering angle in radians.
///
/// # Errors
/// [`crate::Error::Bag`].
pub(super) fn steering(message: &Message<'_>) -> Result<f64> {
    if message.is::<AckermannDriveStamped>() {
        let drive: AckermannDriveStamped = message.decode()?;
        return Ok(f64::from(drive.drive.steering_angle));
    }
    number(message)
}

/// A plain number.
fn number(message: &Message<'_>) -> Result<f64> {
    Ok(if message.is::<Float32>() {
        f64::from(message.decode::<Float32>()?.data)
    } else {
        message.decode::<Float64>()?.data
    })
}
