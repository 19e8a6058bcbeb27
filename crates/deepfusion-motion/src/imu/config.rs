use crate::{Error, ExpectedSetting as Expected, Result};
use deepfusion_geometry::Se3;
use nalgebra::Vector3;
use serde::{Deserialize, Serialize};

/// The mount of an inertial unit on the vehicle, `vehicle_from_imu`.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct ImuMount {
    /// Axis-angle of the rotation from the unit's axes to the vehicle's (x forward, y left, z up), in radians. A unit with x forward, y
    /// right, z down has (π, 0, 0).
    pub rotation_rad: [f64; 3],
    /// The unit's position in the vehicle's frame (origin: middle of the rear axle), in metres.
    pub translation_m: [f64; 3],
}

impl ImuMount {
    /// A unit with its x forward, y right and z down, at the vehicle's origin.
    #[must_use]
    pub fn forward_right_down() -> Self {
        Self {
            rotation_rad: [std::f64::consts::PI, 0.0, 0.0],
            ..Self::default()
        }
    }

    /// The mount as a rigid motion.
    #[must_use]
    pub fn se3(&self) -> Se3 {
        Se3::from_axis_angle(
            Vector3::from(self.rotation_rad),
            Vector3::from(self.translation_m),
        )
    }
}

/// How an inertial unit's recording is processed.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct ImuConfig {
    /// The unit's mount.
    pub vehicle_from_imu: ImuMount,
    /// Time constant of the attitude's complementary filter, in seconds: slower changes of up follow the accelerometer, faster ones the
    /// gyro. The filter removes the vehicle's own acceleration using the speed, so the time constant can be short; with a long one, the
    /// gyro's drift tilts the horizon.
    pub attitude_time_s: f64,
    /// The gyro's bias for recordings without a standstill, in rad/s about the vehicle's axes. If not given, the biases of roll and pitch
    /// are estimated against gravity while driving, and that of yaw against the steering if the vehicle has a steering signal.
    pub gyro_bias_radps: Option<[f64; 3]>,
    /// The conditions for a standstill.
    pub standstill: StandstillConfig,
}

impl Default for ImuConfig {
    fn default() -> Self {
        Self {
            vehicle_from_imu: ImuMount::default(),
            attitude_time_s: 2.0,
            gyro_bias_radps: None,
            standstill: StandstillConfig::default(),
        }
    }
}

/// The conditions for a standstill: the speed is low, and the unit is quiet. Wheel sensors read 0 below walking speed, so the speed alone
/// would count creeping as standing.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct StandstillConfig {
    /// Highest speed, in m/s.
    pub speed_mps: f64,
    /// Largest standard deviation of the angular rate about any axis over a window, in rad/s.
    pub gyro_std_radps: f64,
    /// Largest standard deviation of the acceleration along any axis over a window, in m/s². An idling
    /// engine shakes the unit by some tenths.
    pub acceleration_std_mps2: f64,
    /// Length of a window, and the shortest standstill, in seconds.
    pub window_s: f64,
}

impl Default for StandstillConfig {
    fn default() -> Self {
        Self {
            speed_mps: 0.1,
            gyro_std_radps: 0.01,
            acceleration_std_mps2: 0.3,
            window_s: 1.0,
        }
    }
}

impl ImuConfig {
    /// Checks every field.
    ///
    /// # Errors
    /// [`Error::Config`], naming the first field out of range.
    pub fn validate(&self) -> Result<()> {
        let check = |ok: bool, field, value: f64, expected| {
            ok.then_some(()).ok_or(Error::Config {
                field,
                value,
                expected,
            })
        };
        let mount = &self.vehicle_from_imu;
        for value in mount.rotation_rad {
            let turn = std::f64::consts::TAU;
            check(
                value.abs() <= turn,
                "vehicle_from_imu.rotation_rad",
                value,
                Expected::Angles,
            )?;
        }
        for value in mount.translation_m {
            check(
                value.abs() <= 50.0,
                "vehicle_from_imu.translation_m",
                value,
                Expected::PlaceOnVehicle,
            )?;
        }
        let most = 1.0;
        for value in self.gyro_bias_radps.unwrap_or_default() {
            check(
                value.abs() <= most,
                "gyro_bias_radps",
                value,
                Expected::AngularRateBelow(most),
            )?;
        }
        let time = self.attitude_time_s;
        let (from, to) = (0.05, 600.0);
        check(
            (from..=to).contains(&time),
            "attitude_time_s",
            time,
            Expected::Seconds { from, to },
        )?;
        let still = &self.standstill;
        let positive = |field, value: f64| {
            check(
                value > 0.0 && value.is_finite(),
                field,
                value,
                Expected::AboveZero,
            )
        };
        positive("standstill.speed_mps", still.speed_mps)?;
        positive("standstill.gyro_std_radps", still.gyro_std_radps)?;
        positive(
            "standstill.acceleration_std_mps2",
            still.acceleration_std_mps2,
        )?;
        positive("standstill.window_s", still.window_s)
    }
}
