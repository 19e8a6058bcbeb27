//! A 6-axis inertial unit with bias and noise.

use crate::oxts::GRAVITY;
use crate::scanner::gaussian;
use crate::texture::noise::{hash, unit};
use deepfusion_geometry::Se3;
use nalgebra::Vector3;

/// Readings per second.
pub(crate) const RATE_HZ: f64 = 100.0;

/// Standard deviations of the noise, m/s² and rad/s: those of a good MEMS unit at this rate.
const NOISE: (f64, f64) = (0.03, 0.002);

/// The largest constant bias of an axis: m/s² and rad/s.
const BIAS: (f64, f64) = (0.08, 0.008);

/// Time between the positions that velocity and acceleration are computed from, seconds.
const STEP_S: f64 = 0.02;

/// A reading of an inertial unit, in its own axes.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ImuReading {
    /// Seconds since the start of the drive.
    pub time_s: f64,
    /// Specific force, m/s²: 9.81 upwards at rest.
    pub acceleration: Vector3<f64>,
    /// Angular rate, rad/s.
    pub angular_rate: Vector3<f64>,
}

/// Motion of a body at one instant, from its poses shortly before and after.
#[derive(Debug, Clone, Copy)]
pub struct BodyMotion {
    /// Its pose, world from body.
    pub pose: Se3,
    /// Velocity, world axes, m/s.
    pub velocity: Vector3<f64>,
    /// Acceleration, world axes, m/s².
    pub acceleration: Vector3<f64>,
    /// Angular rate, body axes, rad/s.
    pub angular_rate: Vector3<f64>,
}

impl BodyMotion {
    /// By central differences of `world_from_body`, a function of time.
    pub fn at(world_from_body: impl Fn(f64) -> Se3, time_s: f64) -> Self {
        let [before, pose, after] =
            [-STEP_S, 0.0, STEP_S].map(|offset| world_from_body(time_s + offset));
        let (a, b, c) = (
            before.translation(),
            pose.translation(),
            after.translation(),
        );
        Self {
            pose,
            velocity: (c - a) / (2.0 * STEP_S),
            acceleration: (c - 2.0 * b + a) / (STEP_S * STEP_S),
            angular_rate: (before.inverse() * after).axis_angle() / (2.0 * STEP_S),
        }
    }
}

impl ImuReading {
    /// The reading during a motion, with bias and noise. `index` is the number of the reading, `seed` that of the drive.
    pub fn of(motion: &BodyMotion, time_s: f64, (index, seed): (usize, u32)) -> Self {
        let held_up = motion.acceleration + Vector3::new(0.0, 0.0, GRAVITY);
        let exact = motion.pose.inverse().rotate(&held_up);
        let noisy = |value: f64, axis: i32, bias: f64, noise: f64| {
            let constant = bias * (2.0 * f64::from(unit(hash(axis, 41, seed), 0)) - 1.0);
            let code = hash(index as i32, axis, seed);
            value + constant + noise * f64::from(gaussian(code, seed ^ 0x1A2B))
        };
        let three = |v: Vector3<f64>, first: i32, bias: f64, noise: f64| {
            Vector3::new(
                noisy(v.x, first, bias, noise),
                noisy(v.y, first + 1, bias, noise),
                noisy(v.z, first + 2, bias, noise),
            )
        };
        Self {
            time_s,
            acceleration: three(exact, 0, BIAS.0, NOISE.0),
            angular_rate: three(motion.angular_rate, 3, BIAS.1, NOISE.1),
        }
    }
}
