//! The gyro's bias without a standstill, from the disagreement between the gyro and the direction of gravity.

use super::ImuSample;
use super::attitude::gravity_reaction;
use crate::Signal;
use nalgebra::{Matrix3, SMatrix, SVector, Vector3};

/// Longest window in which a bias counts as constant, in seconds: the bias follows the unit's temperature.
const WINDOW_S: f64 = 30.0;
/// Shortest window, in seconds.
const SHORTEST_S: f64 = 1.0;
/// Prior standard deviation of the bias, in rad/s.
const USUAL_BIAS: f64 = 0.008;
/// Typical error of the accelerometer's direction of up, in radians, and how long it lasts, in seconds. It comes from bumps and from errors
/// of the acceleration derived from speed.
const UP_ERROR: f64 = 0.01;
const UP_ERROR_S: f64 = 0.5;
/// Typical error of the initial direction of up, in radians.
const START_ERROR: f64 = 0.1;

/// A sensor's bias in three axes, and the time of the estimate.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct DrivingBias {
    pub(crate) middle_s: f64,
    pub(crate) bias: Vector3<f64>,
}

/// The biases about roll and pitch by window, in vehicle axes, in rad/s. The bias about the vertical is not included: gravity does not
/// determine it.
///
/// In each window, the initial direction of up is rotated by the gyro alone. Its deviation from the accelerometer's direction is linear in
/// the initial error δ and in the bias b: up' = −(ω − b) × up.
pub(super) fn tilt_biases(
    samples: &[ImuSample],
    speed: &Signal,
    max_gap_s: f64,
) -> Vec<DrivingBias> {
    by_windows(
        samples,
        |s| s.time_s,
        max_gap_s,
        |window| tilt_bias(window, speed),
    )
}

/// Applies `find` to each window: stretches without a gap, cut into parts of equal length. Windows shorter than a second are left out.
pub(crate) fn by_windows<T>(
    samples: &[T],
    time_s: impl Fn(&T) -> f64,
    max_gap_s: f64,
    find: impl Fn(&[T]) -> Option<Vector3<f64>>,
) -> Vec<DrivingBias> {
    let mut found = Vec::new();
    for stretch in samples.chunk_by(|a, b| time_s(b) - time_s(a) <= max_gap_s) {
        let begin = time_s(&stretch[0]);
        let length_s = time_s(&stretch[stretch.len() - 1]) - begin;
        let window_s = length_s / (length_s / WINDOW_S).ceil().max(1.0) + 1e-9;
        let number = |s: &T| ((time_s(s) - begin) / window_s) as u64;
        for window in stretch.chunk_by(|a, b| number(a) == number(b)) {
            let (from_s, to_s) = (time_s(&window[0]), time_s(&window[window.len() - 1]));
            if to_s - from_s >= SHORTEST_S
                && let Some(bias) = find(window)
            {
                let middle_s = 0.5 * (from_s + to_s);
                found.push(DrivingBias { middle_s, bias });
            }
        }
    }
    found
}

fn tilt_bias(samples: &[ImuSample], speed: &Signal) -> Option<Vector3<f64>> {
    let measured = |s: &ImuSample| gravity_reaction(s, speed)?.try_normalize(1e-6);
    let mut up = samples.iter().find_map(measured)?;
    let (mut by_start, mut by_bias) = (Matrix3::identity(), Matrix3::zeros());
    // Unknowns: the error of the initial direction along x and y, the bias about x and y.
    let priors = [START_ERROR, START_ERROR, USUAL_BIAS, USUAL_BIAS];
    let mut normal =
        SMatrix::<f64, 4, 4>::from_diagonal(&SVector::from(priors.map(|p| p.powi(-2))));
    let mut right = SVector::<f64, 4>::zeros();
    let mut last_s = samples.first()?.time_s;
    for sample in samples {
        let dt = sample.time_s - last_s;
        last_s = sample.time_s;
        let turn = -sample.angular_rate_radps.cross_matrix() * dt;
        // Second order in the step, so that error and direction both refer to the step's middle.
        let step = Matrix3::identity() + turn + 0.5 * turn * turn;
        by_bias = step * by_bias - up.cross_matrix() * dt;
        (up, by_start) = (step * up, step * by_start);
        let Some(measured) = measured(sample) else {
            continue;
        };
        let weight = dt / UP_ERROR_S / UP_ERROR.powi(2);
        let mut rows = SMatrix::<f64, 2, 4>::zeros();
        rows.fixed_columns_mut::<2>(0)
            .copy_from(&by_start.fixed_view::<2, 2>(0, 0));
        rows.fixed_columns_mut::<2>(2)
            .copy_from(&by_bias.fixed_view::<2, 2>(0, 0));
        let left = (measured - up).xy();
        normal += weight * rows.transpose() * rows;
        right += weight * rows.transpose() * left;
    }
    let found = normal.cholesky()?.solve(&right);
    Some(Vector3::new(found[2], found[3], 0.0))
}

/// The bias at a time, interpolated between the estimates before and after; `None` if there are none.
pub(crate) fn at(found: &[DrivingBias], time_s: f64) -> Option<Vector3<f64>> {
    let after = found.partition_point(|b| b.middle_s <= time_s);
    match (after.checked_sub(1).map(|i| found[i]), found.get(after)) {
        (Some(before), Some(next)) => {
            let share = (time_s - before.middle_s) / (next.middle_s - before.middle_s);
            Some(before.bias.lerp(&next.bias, share))
        }
        (Some(only), None) => Some(only.bias),
        (None, next) => next.map(|b| b.bias),
    }
}
