//! Speed from a track of positions, such as a satellite receiver's.
//!
//! Differences between neighbouring positions are noisy: at 1 Hz, a metre of jitter is 1 m/s. So the whole track is smoothed at once: on
//! each axis, position and velocity follow a random acceleration, and measurements are weighted by Student's t (iterative reweighting), so
//! that outliers have less weight. The result at every fix is the velocity given all fixes, before and after (Rauch, Tung, Striebel).

use nalgebra::{Matrix2, Vector2};
use std::f64::consts::PI;

/// Standard deviation of a measured position on an axis, in metres. Receivers claim larger errors, but most of that is
/// constant from second to second and does not affect the speed.
const POSITION_SIGMA_M: f64 = 1.0;
/// Standard deviation of a measured speed, in m/s.
const SPEED_SIGMA_MPS: f64 = 0.15;
/// Spectral density of the random acceleration, m²/s³: the variance that a car's speed gains per second.
const ACCELERATION_DENSITY: f64 = 1.5;
/// Degrees of freedom of Student's t: a small number is robust.
const FREEDOM: f64 = 4.0;
/// Below this speed of the smoothed positions, in m/s, a fix without a speed counts as standing: some apps write only speeds above 0.
const STANDING_MPS: f64 = 1.0;
/// Number of rounds of reweighting.
const ROUNDS: usize = 5;
/// Longest time between two fixes for which a yaw rate is computed, in seconds.
const COURSE_GAP_S: f64 = 3.0;
/// Longest gap within a track, in seconds.
const MAX_GAP_S: f64 = 10.0;
/// The WGS 84 ellipsoid: equatorial radius in metres, and eccentricity squared.
const EQUATOR_M: f64 = 6_378_137.0;
const ECCENTRICITY_2: f64 = 6.694_379_990_14e-3;

/// A position fix of a satellite receiver.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Fix {
    /// Time, in seconds.
    pub time_s: f64,
    /// North of the equator, in degrees.
    pub latitude_deg: f64,
    /// East of Greenwich, in degrees.
    pub longitude_deg: f64,
    /// Speed over ground, in m/s, if the receiver reports it (from Doppler shifts, which is more accurate than differences of positions).
    pub speed_mps: Option<f64>,
}

/// The speed at a fix.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct FixSpeed {
    /// Time, in seconds.
    pub time_s: f64,
    /// Speed over ground, in m/s.
    pub speed_mps: f64,
    /// Standard deviation of the speed, in m/s.
    pub sigma_mps: f64,
    /// Direction of travel according to the smoothed positions, in radians from east to the left; `None` below [`COURSE_MPS`], where
    /// positions do not show it.
    pub course_rad: Option<f64>,
    /// Source of the speed.
    pub source: FixSpeedSource,
}

/// The source of a fix's speed.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum FixSpeedSource {
    /// The receiver.
    Receiver,
    /// The fix has no speed, but most others have one, and its positions show standing: the speed is 0.
    Standing,
    /// The smoothed positions.
    Positions,
}

/// Smallest speed at which positions show a course, m/s: their smoothed velocity is accurate to some tenths.
pub const COURSE_MPS: f64 = 2.0;

/// Rate of turn between neighbouring fixes that both have a course and are at most three seconds apart: time in the middle in seconds, rate
/// in rad/s, positive to the left. Smoothing spreads a turn equally to both sides.
#[must_use]
pub fn course_rates(speeds: &[FixSpeed]) -> Vec<(f64, f64)> {
    let rate = |pair: &[FixSpeed]| {
        let dt_s = pair[1].time_s - pair[0].time_s;
        let turn = pair[1].course_rad? - pair[0].course_rad?;
        let turn = (turn + PI).rem_euclid(2.0 * PI) - PI;
        let middle_s = 0.5 * (pair[0].time_s + pair[1].time_s);
        (dt_s > 0.0 && dt_s <= COURSE_GAP_S).then(|| (middle_s, turn / dt_s))
    };
    speeds.windows(2).filter_map(rate).collect()
}

/// The speed at every fix. Fixes that are not finite, or not later than the one before, are left out. If one fix's time jumped ahead, that
/// fix is left out instead of the following ones. A fix more than ten seconds from both neighbours gets no speed.
///
/// In a part without gaps, the receiver's own speeds are used if at least half of its fixes have one; standing fixes without a speed do not
/// count. There, a fix without a speed gets the speed 0 if its positions stand, and is left out if they move.
#[must_use]
pub fn speeds_of_fixes(fixes: &[Fix]) -> Vec<FixSpeed> {
    let mut kept: Vec<Fix> = Vec::with_capacity(fixes.len());
    for fix in fixes {
        let numbers = [fix.time_s, fix.latitude_deg, fix.longitude_deg];
        if !numbers.iter().all(|n| n.is_finite()) {
            continue;
        }
        if leapt(&kept, fix) {
            kept.pop();
        }
        if kept.last().is_none_or(|last| fix.time_s > last.time_s) {
            kept.push(*fix);
        }
    }
    let parts = kept.chunk_by(|a, b| b.time_s - a.time_s <= MAX_GAP_S);
    parts
        .filter(|part| part.len() > 1)
        .flat_map(speeds)
        .collect()
}

/// Whether the time of the last of `fixes` jumped far ahead: both the fix before it and `next`, which continues from there, are much
/// earlier.
fn leapt(fixes: &[Fix], next: &Fix) -> bool {
    let Some((last, before)) = fixes.split_last() else {
        return false;
    };
    let far = last.time_s - next.time_s > MAX_GAP_S;
    far && before
        .last()
        .is_none_or(|before| next.time_s > before.time_s && last.time_s - before.time_s > MAX_GAP_S)
}

/// The speeds of a track without gaps.
fn speeds(fixes: &[Fix]) -> Vec<FixSpeed> {
    let places = metres(fixes);
    let mut weights = vec![1.0; fixes.len()];
    let mut tracks = [Vec::new(), Vec::new()];
    for _ in 0..ROUNDS {
        for (axis, track) in tracks.iter_mut().enumerate() {
            let measured: Vec<f64> = places.iter().map(|place| place[axis]).collect();
            *track = smoothed(fixes, &measured, &weights);
        }
        for (i, weight) in weights.iter_mut().enumerate() {
            let off = |axis: usize| (tracks[axis][i].state[0] - places[i][axis]) / POSITION_SIGMA_M;
            let square = off(0).powi(2) + off(1).powi(2);
            *weight = (FREEDOM + 2.0) / (FREEDOM + square);
        }
    }
    let [east, north] = &tracks;
    let all = fixes.iter().zip(east.iter().zip(north));
    let of_positions = all.map(|(fix, (east, north))| {
        let (x, y) = (east.state[1], north.state[1]);
        let (var_x, var_y) = (east.covariance[(1, 1)], north.covariance[(1, 1)]);
        let speed = x.hypot(y);
        // The variance along the direction of travel; for a standing fix, the larger one.
        let variance = if speed > 1e-6 {
            (x * x * var_x + y * y * var_y) / (speed * speed)
        } else {
            var_x.max(var_y)
        };
        FixSpeed {
            time_s: fix.time_s,
            speed_mps: speed,
            sigma_mps: variance.sqrt(),
            course_rad: (speed >= COURSE_MPS).then(|| y.atan2(x)),
            source: FixSpeedSource::Positions,
        }
    });
    of_receiver(fixes, of_positions.collect())
}

/// Replaces the speeds from positions by the receiver's own, if it reports enough of them.
fn of_receiver(fixes: &[Fix], of_positions: Vec<FixSpeed>) -> Vec<FixSpeed> {
    let stands = |by_positions: &FixSpeed| by_positions.speed_mps < STANDING_MPS;
    let measured = fixes.iter().filter(|fix| fix.speed_mps.is_some()).count();
    let both = fixes.iter().zip(&of_positions);
    let unsaid = both.filter(|(fix, of)| fix.speed_mps.is_none() && !stands(of));
    if measured == 0 || unsaid.count() > measured {
        return of_positions;
    }
    let both = fixes.iter().zip(of_positions);
    both.filter_map(|(fix, of_positions)| match fix.speed_mps {
        Some(measured) => Some(FixSpeed {
            speed_mps: measured.max(0.0),
            sigma_mps: SPEED_SIGMA_MPS,
            source: FixSpeedSource::Receiver,
            ..of_positions
        }),
        None => stands(&of_positions).then_some(FixSpeed {
            speed_mps: 0.0,
            source: FixSpeedSource::Standing,
            ..of_positions
        }),
    })
    .collect()
}

/// East and north of the first fix, in metres, on the plane that touches the ellipsoid in the middle of the track: within some kilometres
/// the scale is accurate to a millionth.
fn metres(fixes: &[Fix]) -> Vec<[f64; 2]> {
    let mean = fixes.iter().map(|f| f.latitude_deg).sum::<f64>() / fixes.len() as f64;
    let (sin, cos) = mean.to_radians().sin_cos();
    let w = 1.0 - ECCENTRICITY_2 * sin * sin;
    let per_longitude = EQUATOR_M / w.sqrt() * cos;
    let per_latitude = EQUATOR_M * (1.0 - ECCENTRICITY_2) / w.powf(1.5);
    let first = fixes[0];
    let place = |fix: &Fix| {
        // Differences across the date line are small, too.
        let east = (fix.longitude_deg - first.longitude_deg + 540.0).rem_euclid(360.0) - 180.0;
        let north = fix.latitude_deg - first.latitude_deg;
        [
            east.to_radians() * per_longitude,
            north.to_radians() * per_latitude,
        ]
    };
    fixes.iter().map(place).collect()
}

/// Position and velocity on an axis.
#[derive(Clone, Copy)]
struct Estimate {
    state: Vector2<f64>,
    covariance: Matrix2<f64>,
}

/// The smoother on one axis; a weight of one half doubles a measurement's variance.
fn smoothed(fixes: &[Fix], measured: &[f64], weights: &[f64]) -> Vec<Estimate> {
    // Initially the velocity is unknown.
    let mut next = Estimate {
        state: Vector2::new(measured[0], 0.0),
        covariance: Matrix2::new(1e4, 0.0, 0.0, 1e4),
    };
    let (mut predicted, mut filtered) = (Vec::new(), Vec::new());
    for i in 0..fixes.len() {
        if i > 0 {
            next = advanced(&next, fixes[i].time_s - fixes[i - 1].time_s);
        }
        predicted.push(next);
        let noise = POSITION_SIGMA_M.powi(2) / weights[i].max(1e-9);
        let gain = next.covariance.column(0) / (next.covariance[(0, 0)] + noise);
        let off = measured[i] - next.state[0];
        next = Estimate {
            state: next.state + gain * off,
            covariance: next.covariance - gain * next.covariance.row(0),
        };
        filtered.push(next);
    }
    let mut result = filtered.clone();
    for i in (0..fixes.len().saturating_sub(1)).rev() {
        let step = transition(fixes[i + 1].time_s - fixes[i].time_s);
        let Some(inverse) = predicted[i + 1].covariance.try_inverse() else {
            continue;
        };
        let gain = filtered[i].covariance * step.transpose() * inverse;
        let (later, expected) = (result[i + 1], predicted[i + 1]);
        result[i] = Estimate {
            state: filtered[i].state + gain * (later.state - expected.state),
            covariance: filtered[i].covariance
                + gain * (later.covariance - expected.covariance) * gain.transpose(),
        };
    }
    result
}

fn transition(dt: f64) -> Matrix2<f64> {
    Matrix2::new(1.0, dt, 0.0, 1.0)
}

/// Predicts the state `dt` seconds later.
fn advanced(from: &Estimate, dt: f64) -> Estimate {
    let step = transition(dt);
    let noise = Matrix2::new(dt.powi(3) / 3.0, dt.powi(2) / 2.0, dt.powi(2) / 2.0, dt);
    Estimate {
        state: step * from.state,
        covariance: step * from.covariance * step.transpose() + noise * ACCELERATION_DENSITY,
    }
}

#[cfg(test)]
#[path = "positions_tests.rs"]
mod tests;
