//! One motion from all of a vehicle's sensors (Eq. 28–31).

use crate::{Bicycle, Error, ImuConfig, ImuSample, ImuTrack, Result, Signal, VehicleMotion};
use serde::{Deserialize, Serialize};

/// Yaw rates below this say nothing about left and right, in rad/s.
const TURNING_RADPS: f64 = 0.03;
/// Shorter turning, in seconds, does not prove that two sensors disagree about left and right.
const ENOUGH_TURNING_S: f64 = 3.0;

/// Up to this long the accelerometer's share of a distance is the configured one, in seconds. What is left of its bias grows
/// with the square of time, the wheels' error with time: beyond, its share falls with the square.
const DRIFTS_S: f64 = 1.0;

/// What a vehicle's sensors recorded, on one clock.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct VehicleSensors {
    /// Forward speed, in m/s (negative when reversing, where the vehicle tells).
    pub speed_mps: Signal,
    /// Angle of the steering wheel or of the road wheels, in radians, positive to the left.
    pub steering_rad: Option<Signal>,
    /// Readings of an inertial unit, in its own axes.
    pub imu: Option<Vec<ImuSample>>,
}

/// The weights of the fusion: 1 is the inertial unit alone (of a distance up to a second), 0 the vehicle's speed and
/// steering alone.
///
/// Speed from wheels has a small constant error of scale; speed from an integrated accelerometer
/// drifts. Heading is the reverse: a gyro's error is a slow bias, the steering wheel's angle knows
/// nothing of slip, bumps and cross slope. So distance leans on the wheels, yaw on the gyro.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct FusionConfig {
    /// α_d, the inertial unit's share of the distance (Eq. 30) over up to a second; over T seconds 1/T² of it.
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

/// How a vehicle's sensors become its motion.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct MotionConfig {
    /// True speed over the vehicle's. Wheels count turns: worn or larger tyres make the speed wrong by
    /// a constant percent, and every depth with it. A drive with satellite positions shows it.
    pub speed_scale: f64,
    /// The vehicle's geometry. Without it a steering angle cannot be used.
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

/// What each sensor says about one interval; `None` where there is no such sensor, or it has a gap.
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
    imu: Option<ImuTrack>,
    weights: FusionConfig,
}

impl FusedTrack {
    /// Prepares the sensors' streams. A steering angle without a [`MotionConfig::bicycle`] is left out.
    ///
    /// # Errors
    /// [`Error::TooFewSamples`] without a speed; [`Error::Config`] for settings out of range;
    /// [`Error::NotGravity`], [`Error::NotUp`] for an inertial unit that cannot be read as configured;
    /// [`Error::YawSigns`] where gyro and steering turn opposite ways.
    pub fn new(sensors: &VehicleSensors, config: &MotionConfig) -> Result<Self> {
        config.fusion.validate()?;
        if !(0.5..=2.0).contains(&config.speed_scale) {
            return Err(Error::Config {
                field: "speed_scale",
                value: config.speed_scale,
                expected: "0.5 to 2 (a unit is converted, not scaled)",
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
        if let (Some(steering), Some(imu)) = (&steering_yaw_rate, &imu) {
            check_signs(steering, imu.yaw_rate())?;
        }
        Ok(Self {
            speed_mps: speed.clone(),
            steering_yaw_rate,
            imu,
            weights: config.fusion,
        })
    }

    /// Times of the speed's samples, in seconds.
    #[must_use]
    pub fn times_s(&self) -> &[f64] {
        self.speed_mps.times_s()
    }

    /// Forward speed at a time, in m/s; `None` where the speed does not cover it.
    #[must_use]
    pub fn speed_at(&self, time_s: f64) -> Option<f64> {
        self.speed_mps.at(time_s)
    }

    /// The forward speed over time, in m/s.
    #[must_use]
    pub fn speed(&self) -> &Signal {
        &self.speed_mps
    }

    /// Yaw rate from the steering, in rad/s, where the vehicle has one and its geometry is known.
    #[must_use]
    pub fn steering_yaw_rate(&self) -> Option<&Signal> {
        self.steering_yaw_rate.as_ref()
    }

    /// What the inertial unit says, where there is one.
    #[must_use]
    pub fn imu(&self) -> Option<&ImuTrack> {
        self.imu.as_ref()
    }

    /// Whether anything measures how the vehicle turns. If not, every motion is straight: its distance
    /// is right, its lever arm is not.
    #[must_use]
    pub fn knows_yaw(&self) -> bool {
        self.imu.is_some() || self.steering_yaw_rate.is_some()
    }

    /// What each sensor says about `from_s` to `to_s`. `None` where the speed does not cover it.
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

    /// What the vehicle did from `from_s` to `to_s` (Eq. 30–31): d_F = α_d d_I + (1 − α_d) d_V and θ_F
    /// likewise, α_d falling with the square of time beyond a second. A sensor that is absent, or has a gap there, leaves all the weight to the other.
    /// `None` where the speed has a gap, or all that measures yaw has; or where time runs backward.
    #[must_use]
    pub fn motion(&self, from_s: f64, to_s: f64) -> Option<VehicleMotion> {
        let parts = self.parts(from_s, to_s)?;
        let FusionConfig {
            alpha_distance,
            alpha_yaw,
        } = self.weights;
        let yaw_rad = match (parts.imu_yaw_rad, parts.steering_yaw_rad) {
            (Some(imu), Some(steering)) => alpha_yaw * imu + (1.0 - alpha_yaw) * steering,
            (Some(only), None) | (None, Some(only)) => only,
            (None, None) if self.knows_yaw() => return None,
            (None, None) => 0.0,
        };
        let distance_v = parts.vehicle_distance_m;
        let alpha_distance = alpha_distance * (DRIFTS_S / (to_s - from_s)).min(1.0).powi(2);
        Some(VehicleMotion {
            distance_m: parts.imu_distance_m.map_or(distance_v, |imu| {
                alpha_distance * imu + (1.0 - alpha_distance) * distance_v
            }),
            yaw_rad,
        })
    }
}

impl FusionConfig {
    fn validate(&self) -> Result<()> {
        let weights = [
            ("alpha_distance", self.alpha_distance),
            ("alpha_yaw", self.alpha_yaw),
        ];
        for (field, value) in weights {
            if !(0.0..=1.0).contains(&value) {
                return Err(Error::Config {
                    field,
                    value,
                    expected: "0 to 1",
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
