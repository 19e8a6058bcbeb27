//! A phone's yaw rate. Its mounting is unknown, but gravity shows which way is up: the yaw rate is the gyroscope's rate about
//! that axis. Platforms disagree on the sign of gravity (at rest some report the pull, some the support), so the sign is chosen to
//! agree with the changes of the GPS course.

use crate::log::YawRate;
use crate::note::{TurnSign, TurnsNote};
use nalgebra::Vector3;
use std::f64::consts::{PI, TAU};

/// A three-axis reading, in the phone's own axes.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Sensor {
    pub(crate) ns: i64,
    pub(crate) value: Vector3<f64>,
}

/// The course over ground.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Heading {
    pub(crate) ns: i64,
    /// Clockwise from north.
    pub(crate) clockwise_rad: f64,
}

/// Least agreement (correlation) of turns and course for which the sign is decided.
const DECIDED: f64 = 0.5;
/// Least number of course changes used for it.
const CHANGES: usize = 10;
/// Courses further apart are not compared, in nanoseconds.
const APART_NS: i64 = 3_000_000_000;

/// The rates about the axis that points up, positive to the left, and how they were interpreted.
///
/// `rates` are in rad/s. `accelerations` include gravity, which is by far their largest part on average over the drive.
pub(crate) fn yaw_rates(
    rates: &[Sensor],
    accelerations: &[Sensor],
    course: &[Heading],
) -> (Vec<YawRate>, TurnsNote) {
    let mean = accelerations.iter().map(|a| a.value).sum::<Vector3<f64>>()
        / accelerations.len().max(1) as f64;
    // Without gravity, what is left of a drive's accelerations is a tenth of this.
    let Some(up) = mean.try_normalize(4.0) else {
        return (Vec::new(), TurnsNote::NoGravity);
    };
    let about_up: Vec<(i64, f64)> = rates.iter().map(|r| (r.ns, r.value.dot(&up))).collect();
    let (agreement, changes) = agreement(&about_up, course);
    let (sign, by) = if changes < CHANGES || agreement.abs() < DECIDED {
        (1.0, TurnSign::Assumed)
    } else if agreement > 0.0 {
        (1.0, TurnSign::Agrees)
    } else {
        (-1.0, TurnSign::TurnedRound)
    };
    let turns = about_up.iter().map(|(ns, radps)| YawRate {
        ns: *ns,
        radps: sign * radps,
    });
    (turns.collect(), TurnsNote::AboutGravity(by))
}

/// Correlation of the turns to the left according to the gyroscope and to the course, between neighbouring courses; and their number.
fn agreement(about_up: &[(i64, f64)], course: &[Heading]) -> (f64, usize) {
    let mut angle = 0.0;
    let mut angles = Vec::with_capacity(about_up.len());
    for pair in about_up.windows(2) {
        angles.push((pair[0].0, angle));
        angle += 0.5 * (pair[0].1 + pair[1].1) * (pair[1].0 - pair[0].0) as f64 * 1e-9;
    }
    let at = |ns: i64| {
        let after = angles.partition_point(|(t, _)| *t < ns);
        angles
            .get(after)
            .filter(|_| after > 0)
            .map(|(_, angle)| *angle)
    };
    let (mut product, mut of_gyroscope, mut of_course, mut changes) = (0.0, 0.0, 0.0, 0);
    for pair in course.windows(2) {
        if pair[1].ns - pair[0].ns > APART_NS {
            continue;
        }
        let (Some(from), Some(to)) = (at(pair[0].ns), at(pair[1].ns)) else {
            continue;
        };
        let left = -(pair[1].clockwise_rad - pair[0].clockwise_rad + PI).rem_euclid(TAU) + PI;
        product += left * (to - from);
        of_gyroscope += (to - from).powi(2);
        of_course += left.powi(2);
        changes += 1;
    }
    let scale = (of_gyroscope * of_course).sqrt();
    (if scale > 0.0 { product / scale } else { 0.0 }, changes)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A drive through bends, with a phone mounted askew: its rates, its accelerations with gravity, the course.
    fn drive(felt: f64) -> (Vec<Sensor>, Vec<Sensor>, Vec<Heading>, Vec<f64>) {
        let up = Vector3::new(0.2, 0.9, 0.3).normalize();
        let rate = |t: f64| 0.3 * (0.4 * t).sin();
        let angle = |t: f64| -0.3 / 0.4 * ((0.4 * t).cos() - 1.0);
        let ns = |t: f64| (t * 1e9) as i64;
        let times: Vec<f64> = (0..3000).map(|i| f64::from(i) * 0.02).collect();
        let noise = |t: f64| Vector3::new((7.0 * t).sin(), (9.0 * t).cos(), (11.0 * t).sin());
        let rates = times.iter().map(|t| Sensor {
            ns: ns(*t),
            value: up * rate(*t),
        });
        let accelerations = times.iter().map(|t| Sensor {
            ns: ns(*t),
            value: up * 9.81 * felt + noise(*t),
        });
        let course = (0..60).map(|t| Heading {
            ns: ns(f64::from(t)),
            clockwise_rad: (1.0 - angle(f64::from(t))).rem_euclid(TAU),
        });
        (
            rates.collect(),
            accelerations.collect(),
            course.collect(),
            times.iter().map(|t| rate(*t)).collect(),
        )
    }

    #[test]
    fn the_sign_of_gravity_does_not_matter() {
        for (felt, sign) in [(1.0, TurnSign::Agrees), (-1.0, TurnSign::TurnedRound)] {
            let (rates, accelerations, course, truth) = drive(felt);
            let (turns, note) = yaw_rates(&rates, &accelerations, &course);
            assert_eq!(note, TurnsNote::AboutGravity(sign));
            for (turn, truth) in turns.iter().zip(&truth) {
                assert!(
                    (turn.radps - truth).abs() < 0.01,
                    "{felt}: {} is {truth}",
                    turn.radps
                );
            }
        }
    }

    #[test]
    fn an_unknown_sign_or_axis_gives_a_note() {
        let (rates, accelerations, _, _) = drive(1.0);
        let (turns, note) = yaw_rates(&rates, &accelerations, &[]);
        assert!(!turns.is_empty());
        assert_eq!(note, TurnsNote::AboutGravity(TurnSign::Assumed));
        let (rates, weightless, course, _) = drive(0.0);
        let (turns, note) = yaw_rates(&rates, &weightless, &course);
        assert!(turns.is_empty());
        assert_eq!(note, TurnsNote::NoGravity);
    }
}
