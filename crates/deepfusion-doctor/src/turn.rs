//! The camera's turns compared with the vehicle's: the sign reveals mirrored images, the size a wrong focal length.
//!
//! A camera that turns by Δθ moves the picture by f·Δθ. So turns measured in the images with a focal length that is
//! too large come out too small by the same factor, whatever the scene.

use super::epipolar::EpipolarPair;
use super::finding::{Figure, Limit, Outcome, Severity};
use super::reason::MotionReason;
use super::skip::MotionSkip;
use nalgebra::Vector3;

/// Least standard deviation of the vehicle's yaw rate that can be compared, rad/s.
pub(super) const LEAST_TURN: f64 = 0.015;
const LEAST_PAIRS: usize = 15;
/// Correlation from which the slope is taken as the focal length's ratio; below it, something else is wrong.
const SURE: f64 = 0.9;

pub(super) fn check(pairs: &[EpipolarPair]) -> Outcome {
    let seen: Vec<(f64, f64)> = pairs.iter().filter_map(turns).collect();
    if seen.len() < LEAST_PAIRS {
        let why = MotionSkip::FewTurns {
            pairs: seen.len(),
            needed: LEAST_PAIRS,
        };
        return Outcome::skipped("turn", why);
    }
    let n = seen.len() as f64;
    let mean = |f: fn(&(f64, f64)) -> f64| seen.iter().map(f).sum::<f64>() / n;
    let (mx, my) = (mean(|s| s.0), mean(|s| s.1));
    let (mut xx, mut xy, mut yy) = (0.0, 0.0, 0.0);
    for (x, y) in &seen {
        let (x, y) = (x - mx, y - my);
        xx += x * x;
        xy += x * y;
        yy += y * y;
    }
    let spread = spread(&seen.iter().map(|s| s.0).collect::<Vec<_>>());
    if spread < LEAST_TURN {
        let why = MotionSkip::HardlyTurns {
            spread_radps: spread,
            needed_radps: LEAST_TURN,
        };
        return Outcome::skipped("turn", why);
    }
    let correlation = xy / (xx * yy).sqrt();
    let slope = xy / xx;
    let mut outcome = Outcome::new("turn");
    let figure = Figure::new(
        "correlation of the picture's turns with the vehicle's",
        correlation,
        "",
        Limit::AtLeast(0.5),
    );
    let mirrored = correlation < -0.5;
    let (severity, reason) = if mirrored {
        (Severity::Error, MotionReason::Mirrored)
    } else {
        (Severity::Warning, MotionReason::TurnsUnrelated)
    };
    outcome.judge(severity, figure, || reason);
    if correlation >= SURE {
        let figure = Figure::new(
            "turns in the picture over the vehicle's",
            slope,
            "",
            Limit::Within(0.85, 1.18),
        );
        outcome.judge(Severity::Error, figure, || {
            let factor = slope;
            MotionReason::TurnsFactor { factor }
        });
    }
    outcome
}

/// The standard deviation of yaw rates; 0 without any.
pub(super) fn spread(rates: &[f64]) -> f64 {
    let n = rates.len().max(1) as f64;
    let mean = rates.iter().sum::<f64>() / n;
    let squares = rates.iter().map(|rate| (rate - mean).powi(2));
    (squares.sum::<f64>() / n).sqrt()
}

/// The yaw rate according to the vehicle and to the picture, rad/s, positive to the left.
fn turns(pair: &EpipolarPair) -> Option<(f64, f64)> {
    Some((pair.vehicle_yaw_rate(), -picture_turn(pair)?.y / pair.dt_s))
}

/// The camera's turn according to the points that were followed, radians about its axes.
pub(super) fn picture_turn(pair: &EpipolarPair) -> Option<Vector3<f64>> {
    pair.turn_of_a_pitching_body(&pair.direction()?)
}

/// The picture's yaw rate, rad/s, for plots.
pub(super) fn picture_yaw_rate(pair: &EpipolarPair) -> Option<f64> {
    turns(pair).map(|(_, picture)| picture)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::epipolar::tests::pair;
    use deepfusion_geometry::Se3;

    /// A vehicle that moves one metre ahead in 0.1 s. Its camera turns at one rate (rad/s, left); it reports another one.
    fn ahead(seen: f64, reported: f64) -> EpipolarPair {
        let turn = |rate: f64| Vector3::new(0.0, -0.1 * rate, 0.0);
        let reported = Se3::from_axis_angle(turn(reported), Vector3::z());
        pair(Vector3::z(), turn(seen), reported)
    }

    /// The outcome for a vehicle that reports this many times the rates at which its camera turns.
    fn diagnosed(factor: f64) -> Outcome {
        let rates = (0..20).map(|i| 0.3 * (0.7 * f64::from(i)).sin());
        let pairs: Vec<EpipolarPair> = rates.map(|rate| ahead(rate, factor * rate)).collect();
        check(&pairs)
    }

    #[test]
    fn a_yaw_rate_of_the_wrong_sign_is_to_be_negated() {
        let right = diagnosed(1.0);
        assert!(right.findings.is_empty() && right.skipped.is_none());
        let outcome = diagnosed(-1.0);
        let [finding] = outcome.findings.as_slice() else {
            panic!("{outcome:?}")
        };
        assert_eq!(finding.severity, Severity::Error);
        assert!(finding.hint.contains("negate the yaw rate"));
    }
}
