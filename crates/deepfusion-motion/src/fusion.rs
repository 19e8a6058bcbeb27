//! Fusion of a vehicle's sensors into one motion (Eq. 28–31).

use crate::imu::{DrivingBias, bias_at};
use crate::vehicle_motion::tilt_between;
use crate::yaw_error::{KNOWN_BIAS, UNKNOWN_BIAS, yaw_errors};
use crate::{
    Bicycle, Error, ExpectedSetting, ImuConfig, ImuSample, ImuTrack, Result, Signal, VehicleMotion,
};
use serde::{Deserialize, Serialize};
use std::ops::RangeInclusive;

/// Least yaw rate for the comparison of signs, in rad/s.
const TURNING_RADPS: f64 = 0.03;
/// Least duration of turning, in seconds, that proves two sensors disagree about left and right.
const ENOUGH_TURNING_S: f64 = 3.0;

/// Longest interval, in seconds, in which the accelerometer has its full configured share. The error of its remaining bias grows with the
/// square of time, the wheels' error only linearly, so its share falls with the square of time beyond that.
const DRIFTS_S: f64 = 1.0;

/// Ratios of true to measured speed that tyres can explain.
pub const SPEED_SCALES: RangeInclusive<f64> = 0.5..=2.0;

/// The recorded signals of a vehicle's sensors, on one clock.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct VehicleSensors {
    /// Forward speed, in m/s (negative when reversing, if the vehicle reports it).
    pub speed_mps: Signal,
    /// Angle of the steering wheel or of the road wheels, in radians, positive to the left.
    pub steering_rad: Option<Signal>,
    /// Readings of an inertial unit, in its own axes.
    pub imu: Option<Vec<ImuSample>>,
}

/// The weights of the fusion: 1 uses the inertial unit alone (for distances over up to a second), 0 the vehicle's speed and steering alone.
///
/// Speed from wheels has a small constant error of scale; speed from an integrated accelerometer
/// drifts. Heading is the reverse: a gyro has a slow bias, while the steering angle does not
/// reflect slip, bumps and cross slope. So distance relies on the wheels, yaw on the gyro.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct FusionConfig {
    /// α_d, the inertial unit's share of the distance (Eq. 30) over up to a second; over T seconds it is divided by T².
    pub alpha_distance: f64,
    /// α_θ, the inertial unit's share of the yaw (Eq. 31).
    pub alpha_yaw: f64,
}

impl Default for FusionConfig {
    fn default() -> Self {
        Self {
            alpha_distance: 0.1,
            alpha_yaw: 0.9,
        }
    }
}

/// Settings for computing a vehicle's motion from its sensors.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct MotionConfig {
    /// Ratio of true to measured speed. Wheel speed counts turns: worn or larger tyres scale it by a constant factor, and with it every
    /// depth. A drive with satellite positions reveals the factor.
    pub speed_scale: f64,
    /// The vehicle's geometry. Without it, a steering angle cannot be used.
    pub bicycle: Option<Bicycle>,
    /// The inertial unit's mount and processing.
    pub imu: ImuConfig,
    /// The weights.
    pub fusion: FusionConfig,
}

impl Default for MotionConfig {
    fn default() -> Self {
        Self {
            speed_scale: 1.0,
            bicycle: None,
            imu: ImuConfig::default(),
            fusion: FusionConfig::default(),
        }
    }
}

/// Each sensor's measurement of one interval; `None` if there is no such sensor, or it has a gap.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct MotionParts {
    /// d_V = ∫v dt, in metres (Eq. 26).
    pub vehicle_distance_m: f64,
    /// d_I, in metres (Eq. 24).
    pub imu_distance_m: Option<f64>,
    /// θ_V, in radians (Eq. 27).
    pub steering_yaw_rad: Option<f64>,
    /// θ_I, in radians (Eq. 25).
    pub imu_yaw_rad: Option<f64>,
}

/// A vehicle's motion over time, fused from its sensors.
#[derive(Debug, Clone, PartialEq)]
pub struct FusedTrack {
    speed_mps: Signal,
    steering_yaw_rate: Option<Signal>,
    /// The yaw rates of gyro and steering, without the errors found by comparing them.
    freed_yaw_rates: Option<[Signal; 2]>,
    imu: Option<ImuTrack>,
    weights: FusionConfig,
}

impl FusedTrack {
    /// Prepares the sensors' streams. A steering angle without a [`MotionConfig::bicycle`] is left out.
    ///
    /// # Errors
    /// [`Error::TooFewSamples`] without a speed; [`Error::Config`] for settings out of range; [`Error::NotGravity`], [`Error::NotUp`] for
    /// an inertial unit that contradicts its configuration; [`Error::YawSigns`] if gyro and steering turn in opposite directions.
    pub fn new(sensors: &VehicleSensors, config: &MotionConfig) -> Result<Self> {
        config.fusion.validate()?;
        if !SPEED_SCALES.contains(&config.speed_scale) {
            return Err(Error::Config {
                field: "speed_scale",
                value: config.speed_scale,
                expected: ExpectedSetting::SpeedScale {
                    from: *SPEED_SCALES.start(),
                    to: *SPEED_SCALES.end(),
                },
            });
        }
        let speed = &sensors.speed_mps.map(|v| v * config.speed_scale);
        if speed.is_empty() {
            return Err(Error::TooFewSamples {
                stream: "speed",
                usable: 0,
                total: speed.dropped(),
                needed: 1,
            });
        }
        let steering_yaw_rate = match (&config.bicycle, &sensors.steering_rad) {
            (Some(bicycle), Some(steering)) => {
                bicycle.validate()?;
                Some(bicycle.yaw_rate_signal(speed, steering))
            }
            _ => None,
        };
        let imu = match &sensors.imu {
            Some(samples) => Some(ImuTrack::new(samples, speed, &config.imu)?),
            None => None,
        };
        let mut freed = None;
        if let (Some(bicycle), Some(steering), Some(imu)) =
            (&config.bicycle, &steering_yaw_rate, &imu)
        {
            check_signs(steering, imu.yaw_rate())?;
            let known = !imu.standstills().is_empty() || config.imu.gyro_bias_radps.is_some();
            let usual_bias = if known { KNOWN_BIAS } else { UNKNOWN_BIAS };
            let found = yaw_errors(imu.yaw_rate(), steering, speed, bicycle, usual_bias);
            freed = Some(without_errors(&found, imu.yaw_rate(), steering, speed));
        }
        Ok(Self {
            speed_mps: speed.clone(),
            steering_yaw_rate,
            freed_yaw_rates: freed,
            imu,
            weights: config.fusion,
        })
    }

    /// Times of the speed's samples, in seconds.
    #[must_use]
    pub fn times_s(&self) -> &[f64] {
        self.speed_mps.times_s()
    }

    /// Forward speed at a time, in m/s; `None` if the speed signal does not cover it.
    #[must_use]
    pub fn speed_at(&self, time_s: f64) -> Option<f64> {
        self.speed_mps.at(time_s)
    }

    /// The forward speed over time, in m/s.
    #[must_use]
    pub fn speed(&self) -> &Signal {
        &self.speed_mps
    }

    /// Yaw rate from the steering, in rad/s, if the vehicle has a steering signal and its geometry is known.
    #[must_use]
    pub fn steering_yaw_rate(&self) -> Option<&Signal> {
        self.steering_yaw_rate.as_ref()
    }

    /// The inertial unit's track, if there is one.
    #[must_use]
    pub fn imu(&self) -> Option<&ImuTrack> {
        self.imu.as_ref()
    }

    /// Roll and pitch from the inertial unit at a time, in radians ([`ImuTrack::tilt`]); `None` without one.
    #[must_use]
    pub fn tilt(&self, time_s: f64) -> Option<[f64; 2]> {
        self.imu.as_ref()?.tilt(time_s)
    }

    /// Whether a sensor measures yaw. If not, every motion is straight: its distance is right, but the effect of the lever arm is missing.
    #[must_use]
    pub fn knows_yaw(&self) -> bool {
        self.imu.is_some() || self.steering_yaw_rate.is_some()
    }

    /// Ratio of the gyro's to the steering's yaw at speeds up to `most_mps` (tyres slip in fast bends), and the duration of this turning in
    /// seconds. The ratio is 1 if wheelbase and steering ratio are right. `None` without either sensor, or without turning at these speeds.
    #[must_use]
    pub fn gyro_over_steering(&self, most_mps: f64) -> Option<(f64, f64)> {
        let steering = self.steering_yaw_rate.as_ref()?;
        let gyro = self.imu.as_ref()?.yaw_rate();
        // Least squares with the gyro's bias: gyro = bias + factor · steering, over all slow samples.
        let (mut n, mut turning_s) = (0.0, 0.0);
        let (mut s, mut g, mut ss, mut sg) = (0.0, 0.0, 0.0, 0.0);
        for (times, rate) in gyro.times_s().windows(2).zip(gyro.values()) {
            let step_s = times[1] - times[0];
            let (Some(steered), Some(speed)) = (steering.at(times[0]), self.speed_at(times[0]))
            else {
                continue;
            };
            if step_s > gyro.max_gap_s() || speed.abs() > most_mps {
                continue;
            }
            n += step_s;
            (s, g) = (s + steered * step_s, g + rate * step_s);
            (ss, sg) = (
                ss + steered * steered * step_s,
                sg + steered * rate * step_s,
            );
            if steered.abs() > TURNING_RADPS {
                turning_s += step_s;
            }
        }
        let spread = ss - s * s / n;
        (turning_s > 0.0 && spread > 0.0).then(|| ((sg - s * g / n) / spread, turning_s))
    }

    /// Each sensor's measurement of `from_s` to `to_s`. `None` if the speed does not cover it.
    #[must_use]
    pub fn parts(&self, from_s: f64, to_s: f64) -> Option<MotionParts> {
        if from_s >= to_s {
            return None;
        }
        let vehicle_distance_m = self.speed_mps.integral(from_s, to_s)?;
        // The accelerometer starts over at every interval, from the vehicle's speed.
        let v0 = self.speed_mps.at(from_s)?;
        let imu = self.imu.as_ref();
        let steering = self.steering_yaw_rate.as_ref();
        Some(MotionParts {
            vehicle_distance_m,
            imu_distance_m: imu.and_then(|i| i.distance(from_s, to_s, v0)),
            steering_yaw_rad: steering.and_then(|s| s.integral(from_s, to_s)),
            imu_yaw_rad: imu.and_then(|i| i.yaw(from_s, to_s)),
        })
    }

    /// The vehicle's motion from `from_s` to `to_s` (Eq. 30–31): d_F = α_d d_I + (1 − α_d) d_V and θ_F likewise, where α_d falls with the
    /// square of time beyond a second. If one sensor is absent or has a gap, the other has the whole weight. `None` if the speed has a gap,
    /// or every yaw sensor has one, or `to_s` is before `from_s`.
    #[must_use]
    pub fn motion(&self, from_s: f64, to_s: f64) -> Option<VehicleMotion> {
        let parts = self.parts(from_s, to_s)?;
        let FusionConfig {
            alpha_distance,
            alpha_yaw,
        } = self.weights;
        let freed = self.freed_yaw_rates.as_ref();
        let freed = freed.map(|both| both.each_ref().map(|rate| rate.integral(from_s, to_s)));
        let [imu_yaw_rad, steering_yaw_rad] = match freed {
            // Each without the error found for it, even if the other has a gap.
            Some([imu, steering]) => [
                imu.or(parts.imu_yaw_rad),
                steering.or(parts.steering_yaw_rad),
            ],
            None => [parts.imu_yaw_rad, parts.steering_yaw_rad],
        };
        let yaw_rad = match (imu_yaw_rad, steering_yaw_rad) {
            (Some(imu), Some(steering)) => alpha_yaw * imu + (1.0 - alpha_yaw) * steering,
            (Some(only), None) | (None, Some(only)) => only,
            (None, None) if self.knows_yaw() => return None,
            (None, None) => 0.0,
        };
        let tilts = self.tilt(from_s).zip(self.tilt(to_s));
        let distance_v = parts.vehicle_distance_m;
        let alpha_distance = alpha_distance * (DRIFTS_S / (to_s - from_s)).min(1.0).powi(2);
        Some(VehicleMotion {
            distance_m: parts.imu_distance_m.map_or(distance_v, |imu| {
                alpha_distance * imu + (1.0 - alpha_distance) * distance_v
            }),
            yaw_rad,
            tilt_rad: tilts.map_or([0.0; 2], |(from, to)| tilt_between(from, to, yaw_rad)),
        })
    }
}

/// The yaw rates of gyro and steering without the errors found in them.
fn without_errors(
    found: &[DrivingBias],
    gyro: &Signal,
    steering: &Signal,
    speed: &Signal,
) -> [Signal; 2] {
    let error_at = |time_s| bias_at(found, time_s).unwrap_or_default();
    let gyro_freed = |(t, rate): (&f64, &f64)| (*t, rate - error_at(*t).x);
    let steering_freed = |(t, rate): (&f64, &f64)| {
        let (error, speed) = (error_at(*t), speed.at(*t).unwrap_or_default());
        (*t, rate + error.y * speed + error.z * rate)
    };
    [
        Signal::with_max_gap(
            gyro.times_s().iter().zip(gyro.values()).map(gyro_freed),
            gyro.max_gap_s(),
        ),
        Signal::with_max_gap(
            steering
                .times_s()
                .iter()
                .zip(steering.values())
                .map(steering_freed),
            steering.max_gap_s(),
        ),
    ]
}

impl FusionConfig {
    fn validate(&self) -> Result<()> {
        let weights = [
            ("alpha_distance", self.alpha_distance),
            ("alpha_yaw", self.alpha_yaw),
        ];
        let (from, to) = (0.0, 1.0);
        for (field, value) in weights {
            if !(from..=to).contains(&value) {
                return Err(Error::Config {
                    field,
                    value,
                    expected: ExpectedSetting::Within { from, to },
                });
            }
        }
        Ok(())
    }
}

/// Whether two yaw rates turn the same way.
fn check_signs(steering: &Signal, gyro: &Signal) -> Result<()> {
    let (mut both, mut squares, mut turning_s) = (0.0, [0.0; 2], 0.0);
    for (times, b) in gyro.times_s().windows(2).zip(gyro.values()) {
        let step_s = times[1] - times[0];
        let Some(a) = steering.at(times[0]) else {
            continue;
        };
        if step_s <= gyro.max_gap_s() && a.abs() > TURNING_RADPS && b.abs() > TURNING_RADPS {
            both += a * b * step_s;
            squares = [squares[0] + a * a * step_s, squares[1] + b * b * step_s];
            turning_s += step_s;
        }
    }
    let correlation = both / (squares[0] * squares[1]).sqrt();
    if turning_s >= ENOUGH_TURNING_S && correlation < -0.5 {
        return Err(Error::YawSigns {
            correlation,
            turning_s,
        });
    }
    Ok(())
}
