//! The direction of up from a complementary filter: the gyro over short times, the accelerometer over long ones.

use super::ImuSample;
use crate::Signal;
use nalgebra::Vector3;

/// Half the time over which the speed is differentiated to get the acceleration, in seconds: wheel pulses make shorter differences noisy.
const SLOPE_S: f64 = 0.25;
/// Without a speed, the accelerometer is used only while the norm of its reading is within this of gravity, in m/s².
const CLOSE_TO_GRAVITY: f64 = 0.3;

/// The direction of up in the vehicle's axes, over time.
pub(super) struct Attitude<'a> {
    speed: &'a Signal,
    time_constant_s: f64,
    up: Vector3<f64>,
    last_s: f64,
    last_rate: Vector3<f64>,
}

impl<'a> Attitude<'a> {
    /// Starts with the mean direction over the samples of the first `start_s` seconds.
    pub(super) fn level(
        stretch: &[ImuSample],
        speed: &'a Signal,
        start_s: f64,
        time_constant_s: f64,
    ) -> Self {
        let begin = stretch[0].time_s;
        let first = stretch.iter().take_while(|s| s.time_s <= begin + start_s);
        let sum: Vector3<f64> = first
            .map(|s| gravity_reaction(s, speed).unwrap_or(s.acceleration_mps2))
            .sum();
        Self {
            speed,
            time_constant_s,
            up: sum.try_normalize(1e-6).unwrap_or_else(Vector3::z),
            last_s: begin,
            last_rate: stretch[0].angular_rate_radps,
        }
    }

    /// Advances to the next sample: rotates the direction against the vehicle's rotation, then corrects it towards the accelerometer's.
    /// Returns the new direction of up.
    pub(super) fn advance(&mut self, sample: &ImuSample) -> Vector3<f64> {
        let dt = sample.time_s - self.last_s;
        self.last_s = sample.time_s;
        // Trapezoidal rule: with the sample's own rate alone, roll and pitch would be half an interval early.
        let rate = 0.5 * (self.last_rate + sample.angular_rate_radps);
        self.last_rate = sample.angular_rate_radps;
        // Seen from a body that rotates at ω, a direction d fixed in the world changes by −ω × d.
        let mut up = self.up - rate.cross(&self.up) * dt;
        if let Some(measured) =
            gravity_reaction(sample, self.speed).and_then(|g| g.try_normalize(1e-6))
        {
            up += (measured - up) * (dt / (self.time_constant_s + dt));
        }
        self.up = up.try_normalize(1e-6).unwrap_or(self.up);
        self.up
    }
}

/// The specific force without the vehicle's own acceleration, which is (v̇, v ω_z, 0) for wheels that do not slip. Without a speed: the
/// specific force itself, if its norm is close to gravity.
pub(super) fn gravity_reaction(sample: &ImuSample, speed: &Signal) -> Option<Vector3<f64>> {
    let force = sample.acceleration_mps2;
    if let Some((v, slope)) = speed_and_slope(speed, sample.time_s) {
        return Some(force - Vector3::new(slope, v * sample.angular_rate_radps.z, 0.0));
    }
    ((force.norm() - super::GRAVITY).abs() < CLOSE_TO_GRAVITY).then_some(force)
}

fn speed_and_slope(speed: &Signal, time_s: f64) -> Option<(f64, f64)> {
    let v = speed.at(time_s)?;
    let (first, last) = (speed.times_s().first()?, speed.times_s().last()?);
    let (from, to) = (
        (time_s - SLOPE_S).max(*first),
        (time_s + SLOPE_S).min(*last),
    );
    if to - from < SLOPE_S || !speed.covers(from, to) {
        return None;
    }
    Some((v, (speed.at(to)? - speed.at(from)?) / (to - from)))
}
