//! What gyro and steering are wrong by about the vertical, found by what they disagree by while driving.

use crate::imu::{DrivingBias, by_windows};
use crate::{Bicycle, Signal};
use nalgebra::{SMatrix, SVector, Vector3};

/// Usual errors of the road wheels' straight ahead, in radians: a degree of the steering wheel.
const USUAL_OFFSET: f64 = 0.001;
/// Usual errors of the steering's factor: wheelbase, ratio, and tyres that slip.
const USUAL_FACTOR: f64 = 0.1;
/// Usual errors of the steering's yaw rate, in rad/s, and how long one lasts, in seconds.
const RATE_ERROR: f64 = 0.01;
const RATE_ERROR_S: f64 = 0.5;

/// How well the gyro's bias is known before the two are compared, in rad/s: not at all, or from a standstill.
pub(crate) const UNKNOWN_BIAS: f64 = 0.01;
pub(crate) const KNOWN_BIAS: f64 = 1e-4;

/// By windows: the gyro's bias in rad/s; the steering's error per speed, in rad/m (it is not straight where it says
/// so); and the share by which it turns too little (the vehicle's geometry).
///
/// gyro − steering is the sum of the three: least squares, each held to what is usual. On a straight drive at one speed
/// the first two cannot be told apart, and the difference goes where it is likelier.
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
