//! Distance and heading from an inertial unit (Eq. 23–25): its readings are rotated into the vehicle's axes and freed of bias and gravity.

mod attitude;
mod config;
mod driving_bias;
mod standstill;

pub use config::{ImuConfig, ImuMount, StandstillConfig};
pub(crate) use driving_bias::{DrivingBias, at as bias_at, by_windows};
pub use standstill::{Standstill, standstills};

use crate::{Error, Result, Signal};
use attitude::Attitude;
use nalgebra::Vector3;

/// Standard gravity, m/s².
pub(crate) const GRAVITY: f64 = 9.806_65;

/// Plausible norm of a drive's mean specific force, m/s²: gravity, with tolerance for a drive that ends faster than it began and an
/// accelerometer that is off by some percent.
const GRAVITY_RANGE: std::ops::Range<f64> = 8.3..11.3;
/// Largest tilt of a mount, in radians: beyond it, axes are assumed to be swapped.
const MOST_TILT_RAD: f64 = std::f64::consts::FRAC_PI_4;

/// Time constant of the filter for the body's roll and pitch, in seconds. It is long because over the second between two frames the
/// unbiased gyro is accurate to a thousandth of a radian, and the accelerometer is not.
const TILT_TIME_S: f64 = 15.0;

/// One reading of an inertial unit.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ImuSample {
    /// Time, in seconds.
    pub time_s: f64,
    /// Specific force along the unit's axes, in m/s². It includes gravity: a unit at rest reads +9.81 along the axis that points up.
    pub acceleration_mps2: Vector3<f64>,
    /// Angular rate about the unit's axes, in rad/s.
    pub angular_rate_radps: Vector3<f64>,
}

impl ImuSample {
    fn is_finite(&self) -> bool {
        let all = |v: &Vector3<f64>| v.iter().all(|x| x.is_finite());
        self.time_s.is_finite() && all(&self.acceleration_mps2) && all(&self.angular_rate_radps)
    }
}

/// A vehicle's motion over time, as measured by an inertial unit.
#[derive(Debug, Clone, PartialEq)]
pub struct ImuTrack {
    forward_mps2: Signal,
    yaw_rate_radps: Signal,
    /// Rates about the vehicle's x (roll) and y (pitch).
    tilt_rates_radps: [Signal; 2],
    /// Roll and pitch relative to gravity.
    tilt_rad: [Signal; 2],
    standstills: Vec<Standstill>,
}

impl ImuTrack {
    /// Processes a recording. `speed` is the vehicle's speed in m/s on the same clock. It serves to find the standstills (for the biases),
    /// and its derivative is removed from the specific force to find up.
    ///
    /// # Errors
    /// [`Error::TooFewSamples`], [`Error::NotGravity`] (wrong units, or gravity already removed), [`Error::NotUp`] (the mount is wrong:
    /// upside down, axes swapped), [`Error::Config`].
    pub fn new(samples: &[ImuSample], speed: &Signal, config: &ImuConfig) -> Result<Self> {
        config.validate()?;
        let vehicle_from_imu = config.vehicle_from_imu.se3();
        let in_vehicle = |s: &ImuSample| ImuSample {
            time_s: s.time_s,
            acceleration_mps2: vehicle_from_imu.rotate(&s.acceleration_mps2),
            angular_rate_radps: vehicle_from_imu.rotate(&s.angular_rate_radps),
        };
        let mut clean: Vec<ImuSample> = Vec::with_capacity(samples.len());
        for sample in samples.iter().filter(|s| s.is_finite()) {
            if clean.last().is_none_or(|last| sample.time_s > last.time_s) {
                clean.push(in_vehicle(sample));
            }
        }
        if clean.len() < 2 {
            return Err(Error::TooFewSamples {
                stream: "imu",
                usable: clean.len(),
                total: samples.len(),
                needed: 2,
            });
        }
        check_gravity(&clean)?;

        let standstills = standstills(&clean, speed, &config.standstill);
        let max_gap_s = Signal::new(clean.iter().map(|s| (s.time_s, 0.0))).max_gap_s();
        let driving = match (standstills.is_empty(), config.gyro_bias_radps) {
            (true, None) => driving_bias::tilt_biases(&clean, speed, max_gap_s),
            _ => Vec::new(),
        };
        let configured = Vector3::from(config.gyro_bias_radps.unwrap_or_default());
        for sample in &mut clean {
            sample.angular_rate_radps -= standstill::gyro_bias(&standstills, sample.time_s)
                .or_else(|| bias_at(&driving, sample.time_s))
                .unwrap_or(configured);
            // The unit is not at the vehicle's origin: in a bend it measures ω × (ω × r) in addition. (ω̇ × r is not removed, since the
            // noise of a differentiated gyro is larger than the term.)
            let omega = sample.angular_rate_radps;
            sample.acceleration_mps2 -= omega.cross(&omega.cross(&vehicle_from_imu.translation()));
        }

        // All signals derived from the samples have the same gaps.
        let (mut forward, mut yaw) = (Vec::new(), Vec::new());
        let mut tilt = [Vec::new(), Vec::new()];
        for stretch in clean.chunk_by(|a, b| b.time_s - a.time_s <= max_gap_s) {
            let start_s = config.attitude_time_s;
            let mut attitude = Attitude::level(stretch, speed, start_s, start_s);
            let mut slow_attitude =
                Attitude::level(stretch, speed, start_s, TILT_TIME_S.max(start_s));
            for sample in stretch {
                let up = attitude.advance(sample);
                let slow_up = slow_attitude.advance(sample);
                // The horizontal forward direction: the specific force along it is the vehicle's acceleration alone, whether the unit's
                // nose points up or down.
                let ahead = Vector3::x() - up * up.x;
                let ahead = ahead / ahead.norm().max(1e-9);
                forward.push((sample.time_s, sample.acceleration_mps2.dot(&ahead)));
                yaw.push((sample.time_s, sample.angular_rate_radps.dot(&up)));
                // Up is the third row of Rz(yaw)·Ry(pitch)·Rx(roll).
                tilt[0].push((sample.time_s, slow_up.y.atan2(slow_up.z)));
                tilt[1].push((sample.time_s, (-slow_up.x).clamp(-1.0, 1.0).asin()));
            }
        }
        Ok(Self {
            forward_mps2: Signal::with_max_gap(forward, max_gap_s),
            yaw_rate_radps: Signal::with_max_gap(yaw, max_gap_s),
            tilt_rates_radps: [0, 1].map(|axis| {
                let rate = |s: &ImuSample| (s.time_s, s.angular_rate_radps[axis]);
                Signal::with_max_gap(clean.iter().map(rate), max_gap_s)
            }),
            tilt_rad: tilt.map(|angles| Signal::with_max_gap(angles, max_gap_s)),
            standstills,
        })
    }

    /// Yaw rate about the vertical, in rad/s, positive to the left, without the standstills' bias.
    #[must_use]
    pub fn yaw_rate(&self) -> &Signal {
        &self.yaw_rate_radps
    }

    /// Roll (the left side up) and pitch (the nose down) relative to gravity at a time, in radians: from the gyro over short times, from
    /// the accelerometer over long ones. Climbing counts as pitch. `None` if the recording does not cover the time.
    #[must_use]
    pub fn tilt(&self, time_s: f64) -> Option<[f64; 2]> {
        let [roll, pitch] = &self.tilt_rad;
        Some([roll.at(time_s)?, pitch.at(time_s)?])
    }

    /// Roll rate about the vehicle's x in rad/s, positive if the left side rises.
    #[must_use]
    pub fn roll_rate(&self) -> &Signal {
        &self.tilt_rates_radps[0]
    }

    /// Pitch rate about the vehicle's y in rad/s, positive if the nose goes down.
    #[must_use]
    pub fn pitch_rate(&self) -> &Signal {
        &self.tilt_rates_radps[1]
    }

    /// The standstills. Without any, the gyro's bias comes from the configuration or is estimated while driving.
    #[must_use]
    pub fn standstills(&self) -> &[Standstill] {
        &self.standstills
    }

    /// d_I in metres (Eq. 23–24): v_I(t) = v₀ + ∫a_x dt from the speed `v0_mps` at `from_s`, and its integral. `None` if the recording does
    /// not cover the time.
    #[must_use]
    pub fn distance(&self, from_s: f64, to_s: f64, v0_mps: f64) -> Option<f64> {
        Some(v0_mps * (to_s - from_s) + self.forward_mps2.double_integral(from_s, to_s)?)
    }

    /// θ_I in radians (Eq. 25): ∫ω_z dt. `None` if the recording does not cover the time.
    #[must_use]
    pub fn yaw(&self, from_s: f64, to_s: f64) -> Option<f64> {
        self.yaw_rate_radps.integral(from_s, to_s)
    }
}

/// Checks that the mean specific force is one g upward, so that wrong units or a wrong mount are found before anything is integrated.
fn check_gravity(samples: &[ImuSample]) -> Result<()> {
    let sum: Vector3<f64> = samples.iter().map(|s| s.acceleration_mps2).sum();
    let mean = sum / samples.len() as f64;
    let norm = mean.norm();
    // An overflowing sum is not gravity either.
    if !GRAVITY_RANGE.contains(&norm) {
        return Err(Error::NotGravity {
            found: mean.into(),
            norm,
        });
    }
    let angle = (mean.z / norm).clamp(-1.0, 1.0).acos();
    if angle > MOST_TILT_RAD {
        return Err(Error::NotUp {
            found: mean.into(),
            angle_deg: angle.to_degrees(),
        });
    }
    Ok(())
}
