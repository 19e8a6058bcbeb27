//! Errors of gyro and steering about the vertical, estimated from their disagreement while driving.

use crate::imu::{DrivingBias, by_windows};
use crate::{Bicycle, Signal};
use nalgebra::{SMatrix, SVector, Vector3};

/// Prior standard deviation of the road wheels' zero, in radians: a degree of the steering wheel.
const USUAL_OFFSET: f64 = 0.001;
/// Prior standard deviation of the steering's relative error: wheelbase, ratio, and slipping tyres.
const USUAL_FACTOR: f64 = 0.1;
/// Typical error of the steering's yaw rate, in rad/s, and how long it lasts, in seconds.
const RATE_ERROR: f64 = 0.01;
const RATE_ERROR_S: f64 = 0.5;

/// Prior standard deviation of the gyro's bias, in rad/s: if unknown, and if known from a standstill.
pub(crate) const UNKNOWN_BIAS: f64 = 0.01;
pub(crate) const KNOWN_BIAS: f64 = 1e-4;

/// Estimates by window: the gyro's bias in rad/s; the steering's error per speed, in rad/m (an error of its zero); and the relative error
/// of its yaw rate (from the vehicle's geometry).
///
/// gyro − steering is the sum of the three: least squares with a prior on each. On a straight drive at constant speed the first two cannot
/// be separated, and the difference is attributed to the likelier one.
pub(crate) fn yaw_errors(
    gyro: &Signal,
    steering: &Signal,
    speed: &Signal,
    bicycle: &Bicycle,
    usual_bias: f64,
) -> Vec<DrivingBias> {
    let readings: Vec<[f64; 4]> = gyro
        .times_s()
        .iter()
        .zip(gyro.values())
        .filter_map(|(t, gyro)| Some([*t, *gyro, steering.at(*t)?, speed.at(*t)?]))
        .collect();
    let usual = [usual_bias, USUAL_OFFSET / bicycle.wheelbase_m, USUAL_FACTOR];
    by_windows(
        &readings,
        |r| r[0],
        gyro.max_gap_s(),
        |window| yaw_error(window, usual),
    )
}

fn yaw_error(readings: &[[f64; 4]], usual: [f64; 3]) -> Option<Vector3<f64>> {
    let held = SVector::from(usual.map(|error| error.powi(-2)));
    let mut normal = SMatrix::<f64, 3, 3>::from_diagonal(&held);
    let mut right = Vector3::zeros();
    for pair in readings.windows(2) {
        let [time_s, gyro, steering, speed] = pair[1];
        let weight = (time_s - pair[0][0]) / RATE_ERROR_S / RATE_ERROR.powi(2);
        let row = Vector3::new(1.0, speed, steering);
        normal += weight * row * row.transpose();
        right += weight * (gyro - steering) * row;
    }
    Some(normal.cholesky()?.solve(&right))
}
