//! Inertial unit and steering angle recorded with the speeds, and the motion computed from all of them.

use super::clock::seconds;
use super::samples::Samples;
use super::table::{Column, Table};
use crate::{MotionModel, Quantity, Result};
use deepfusion_motion::{FusedTrack, ImuSample, MotionConfig, Signal, VehicleSensors};
use nalgebra::Vector3;

/// Possible names of the columns, before `_x`, `_y` or `_z`, and short names for the three axes.
const RATES: ([&str; 3], [&str; 3]) = (["gyro", "angular_velocity", "omega"], ["wx", "wy", "wz"]);
const ACCELERATIONS: ([&str; 4], [&str; 3]) = (
    ["accel", "acc", "acceleration", "linear_acceleration"],
    ["ax", "ay", "az"],
);
/// Standard gravity, m/s².
const GRAVITY_MPS2: f64 = 9.806_65;

/// A vehicle's measurements other than speed, on the recording's clock.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct VehicleLog {
    /// Samples with their times in nanoseconds; the samples' own time is not set.
    pub(crate) imu: Vec<(i64, ImuSample)>,
    /// Steering angle, positive to the left.
    pub(crate) steering_rad: Option<Samples>,
    /// Mounts, the vehicle's geometry and weights.
    pub(crate) config: MotionConfig,
}

impl VehicleLog {
    /// The motion from speed, inertial unit and steering, on a clock that starts at `origin_ns`, and whether its turns are
    /// known.
    ///
    /// # Errors
    /// [`deepfusion_motion::Error`] for sensors that cannot be used as configured, or contradict each other.
    pub(crate) fn motion(
        &self,
        speeds_mps: &Samples,
        origin_ns: i64,
    ) -> deepfusion_motion::Result<(MotionModel, bool)> {
        let signal = |samples: &Samples| {
            let pairs = samples.ns.iter().zip(&samples.values);
            Signal::new(pairs.map(|(ns, v)| (seconds(*ns, origin_ns), *v)))
        };
        let imu = self.imu.iter().map(|(ns, sample)| ImuSample {
            time_s: seconds(*ns, origin_ns),
            ..*sample
        });
        let sensors = VehicleSensors {
            speed_mps: signal(speeds_mps),
            steering_rad: self.steering_rad.as_ref().map(signal),
            imu: (!self.imu.is_empty()).then(|| imu.collect()),
        };
        let track = FusedTrack::new(&sensors, &self.config)?;
        let yaw_known = track.knows_yaw();
        Ok((track.into(), yaw_known))
    }
}

/// The samples in a table that has all three rates and all three accelerations; `None` if it does not.
///
/// # Errors
/// [`crate::Error::Columns`] for a column with a missing or unknown unit, [`crate::Error::Table`] for an invalid value.
pub(crate) fn imu_readings(
    table: &Table,
    ns: &[i64],
    rate_factor: impl Fn(&Column) -> Result<f64>,
) -> Result<Option<Vec<(i64, ImuSample)>>> {
    let rates = axes(table, &RATES.0, &RATES.1);
    let accelerations = axes(table, &ACCELERATIONS.0, &ACCELERATIONS.1);
    let (Some(rates), Some(accelerations)) = (rates, accelerations) else {
        return Ok(None);
    };
    let rates = values(table, rates, rate_factor)?;
    let accelerations = values(table, accelerations, |c| acceleration_factor(table, c))?;
    let at = |axes: &[Vec<f64>; 3], row: usize| Vector3::from([0, 1, 2].map(|i| axes[i][row]));
    let mut readings: Vec<(i64, ImuSample)> = Vec::with_capacity(ns.len());
    for (row, ns) in ns.iter().enumerate() {
        // Of rows with the same time the first counts, as in every table.
        if readings.last().is_some_and(|(last, _)| last == ns) {
            continue;
        }
        let sample = ImuSample {
            time_s: 0.0,
            acceleration_mps2: at(&accelerations, row),
            angular_rate_radps: at(&rates, row),
        };
        readings.push((*ns, sample));
    }
    Ok(Some(readings))
}

/// The columns of the three axes with one of the names.
fn axes<'a>(table: &'a Table, names: &[&str], short: &[&str; 3]) -> Option<[&'a Column; 3]> {
    let find = |axis: usize| {
        let long = names
            .iter()
            .map(|n| format!("{n}_{}", ["x", "y", "z"][axis]));
        let all: Vec<String> = long.chain([short[axis].to_owned()]).collect();
        let all: Vec<&str> = all.iter().map(String::as_str).collect();
        table.column(&all)
    };
    Some([find(0)?, find(1)?, find(2)?])
}

fn values(
    table: &Table,
    columns: [&Column; 3],
    factor: impl Fn(&Column) -> Result<f64>,
) -> Result<[Vec<f64>; 3]> {
    let mut all = [Vec::new(), Vec::new(), Vec::new()];
    for (values, column) in all.iter_mut().zip(columns) {
        let factor = factor(column)?;
        *values = table.numbers(column)?.iter().map(|v| v * factor).collect();
    }
    Ok(all)
}

/// Factor from the column's unit to m/s².
fn acceleration_factor(table: &Table, column: &Column) -> Result<f64> {
    match column.unit.as_deref() {
        Some("mps2" | "m/s2" | "m/s^2" | "m/s²") => Ok(1.0),
        Some("g") => Ok(GRAVITY_MPS2),
        other => Err(table.no_unit(Quantity::Acceleration, column, other)),
    }
}
