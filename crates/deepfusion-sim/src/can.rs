//! The vehicle's CAN signals: speed and the angle of its front wheels.

use crate::scanner::gaussian;
use crate::texture::noise::hash;

/// Readings of the speed per second.
pub(crate) const SPEED_RATE_HZ: f64 = 50.0;
/// Readings of the road-wheel angle per second.
pub(crate) const STEERING_RATE_HZ: f64 = 80.0;

/// Wheelbase, metres.
pub const WHEELBASE_M: f64 = 2.7;

/// Resolution of the speed, m/s (0.05 km/h), and standard deviation of its noise.
const SPEED_STEP: f64 = 0.05 / 3.6;
const SPEED_NOISE: f64 = 0.02;
/// Resolution of the road-wheel angle, radians, and standard deviation of its noise.
const ANGLE_STEP: f64 = 5e-4;
const ANGLE_NOISE: f64 = 8e-4;

/// Speed of the middle of the rear axle.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SpeedReading {
    /// Seconds since the start of the drive.
    pub time_s: f64,
    /// Forward speed, m/s.
    pub speed_mps: f64,
}

/// Angle of the front wheels.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SteeringReading {
    /// Seconds since the start of the drive.
    pub time_s: f64,
    /// Angle of a single wheel in the middle of the front axle, positive to the left, radians.
    pub angle_rad: f64,
}

impl SpeedReading {
    pub(crate) fn of(time_s: f64, speed_mps: f64, index: usize, seed: u32) -> Self {
        let noisy = speed_mps + SPEED_NOISE * normal(index, 61, seed);
        Self {
            time_s,
            speed_mps: (noisy / SPEED_STEP).round().max(0.0) * SPEED_STEP,
        }
    }
}

impl SteeringReading {
    /// Road-wheel angle δ of a vehicle whose rear axle turns at `yaw_rate` (rad/s) and moves at `speed_mps`: tan δ = L·ω/v.
    pub(crate) fn of(
        time_s: f64,
        (speed_mps, yaw_rate): (f64, f64),
        index: usize,
        seed: u32,
    ) -> Self {
        let exact = (WHEELBASE_M * yaw_rate).atan2(speed_mps.max(1e-3));
        let noisy = exact + ANGLE_NOISE * normal(index, 67, seed);
        Self {
            time_s,
            angle_rad: (noisy / ANGLE_STEP).round() * ANGLE_STEP,
        }
    }
}

fn normal(index: usize, channel: i32, seed: u32) -> f64 {
    f64::from(gaussian(hash(index as i32, channel, seed), seed ^ 0x33))
}
