//! Where the camera looks against where it goes.
//!
//! Driving straight, everything streams out of the point headed for. The mount (`cam_from_vehicle`) says where that is
//! in the image; the images say where it is. A difference is an error of the mount's pitch and yaw, or of the principal
//! point: both put the vehicle's motion in a wrong direction.

use super::epipolar::{EpipolarPair, YawTrust, heading_error};
use super::finding::{Figure, Limit, Outcome, Severity};
use super::survey::Survey;
use deepfusion_hint::count_of;
use nalgebra::Vector2;

/// Straight enough, rad/s, and fast enough, m/s.
const MOST_TURN: f64 = 0.06;
const LEAST_MPS: f64 = 1.0;
const LEAST_PAIRS: usize = 12;
/// Pairs looked at.
const MOST_PAIRS: usize = 48;
/// The drive is cut into so many parts; their differences tell how sure the direction is.
const PARTS: usize = 4;
/// Standard error that is sure enough, degrees.
const SURE_DEG: f64 = 0.5;
/// The vehicle's yaw is known to this, radians a pair.
const YAW: YawTrust = YawTrust(0.001);
/// Differences that matter, degrees.
const WARN_DEG: f64 = 1.5;
const ERROR_DEG: f64 = 5.0;

pub(super) fn check(survey: &Survey<'_>, pairs: &[EpipolarPair]) -> Outcome {
    let straight: Vec<&EpipolarPair> = pairs
        .iter()
        .filter(|p| p.vehicle_yaw_rate().abs() < MOST_TURN && p.speed_mps > LEAST_MPS)
        .collect();
    if straight.len() < LEAST_PAIRS {
        let why = format!(
            "{} straight ahead, {LEAST_PAIRS} are needed",
            count_of(straight.len(), "pair")
        );
        return Outcome::skipped("heading", why);
    }
    let thin = straight.len().div_ceil(MOST_PAIRS);
    let straight: Vec<&EpipolarPair> = straight.into_iter().step_by(thin).collect();
    let parts: Vec<Vector2<f64>> = straight
        .chunks(straight.len().div_ceil(PARTS))
        .map(|part| heading_error(part, YAW))
        .collect();
    let whole = heading_error(&straight, YAW);
    let n = parts.len() as f64;
    let spread = |axis: usize| {
        let square: f64 = parts.iter().map(|p| (p[axis] - whole[axis]).powi(2)).sum();
        (square / (n * (n - 1.0).max(1.0))).sqrt().to_degrees()
    };
    let k = &survey.dataset.intrinsics(0);
    let mut outcome = Outcome::new("heading");
    let axes = [
        ("pitch of the way ahead", 0, k.fy, "cy", "up"),
        ("yaw of the way ahead", 1, k.fx, "cx", "right"),
    ];
    let mut unsure = Vec::new();
    for (quantity, axis, focal, name, side) in axes {
        let (off, error) = (whole[axis].to_degrees(), spread(axis));
        if error > SURE_DEG {
            unsure.push(format!("{quantity} {off:.1} ± {error:.1} degrees"));
            continue;
        }
        let limit = WARN_DEG.max(3.0 * error);
        let severity = if off.abs() > ERROR_DEG {
            Severity::Error
        } else {
            Severity::Warning
        };
        let figure = Figure::new(quantity, off, "degrees", Limit::Within(-limit, limit));
        outcome.judge(severity, figure, || {
            let pixels = focal * whole[axis].tan();
            // v grows downward, the angle upward.
            let pixels = if axis == 0 { -pixels } else { pixels };
            (
                format!(
                    "driving straight, the camera heads {:.1} ± {error:.1} degrees further {} than its mount says",
                    off.abs(),
                    if off > 0.0 { side } else if axis == 0 { "down" } else { "left" },
                ),
                format!(
                    "correct the camera's {} on the vehicle by that angle, or, if the mount is right, {name} by {pixels:+.0} px",
                    if axis == 0 { "pitch" } else { "yaw" }
                )
                .into(),
            )
        });
    }
    if outcome.measured.is_empty() {
        outcome.skipped = Some(format!("not sure enough: {}", unsure.join(", ")));
    }
    outcome
}
