//! The camera's direction of view compared with its direction of travel.
//!
//! On a straight drive, everything moves away from the point headed for. The mount (`cam_from_vehicle`) gives its position
//! in the image; the images show where it is. A difference is an error of the mount's pitch and yaw, or of the principal
//! point: both give the vehicle's motion a wrong direction.

use super::epipolar::{self, EpipolarPair, YawTrust, heading_error};
use super::finding::{Figure, Limit, Outcome, Severity};
use super::reason::{CameraReason, HeadingAngle};
use super::skip::{CameraSkip, NoHeading, UnsureHeading};
use super::survey::Survey;
use deepfusion_data::{Dataset, Heading};
use nalgebra::Vector2;

/// Largest yaw rate that counts as straight, rad/s, and lowest speed, m/s.
const MOST_TURN: f64 = 0.06;
const LEAST_MPS: f64 = 1.0;
const LEAST_PAIRS: usize = 12;
/// Number of pairs used.
const MOST_PAIRS: usize = 48;
/// The drive is cut into this many parts; their differences give the standard error of the direction.
const PARTS: usize = 4;
/// Largest standard error that is accurate enough, degrees.
const SURE_DEG: f64 = 0.5;
/// Standard deviation of the vehicle's yaw, radians a pair.
const YAW: YawTrust = YawTrust(0.001);
/// Differences that count as a mistake, degrees. A degree of pitch is some 12 % of the learned metres. In dark and slow places the same is
/// found although nothing is wrong.
const WARN_DEG: f64 = 1.5;
const ERROR_DEG: f64 = 5.0;

/// Frames and pairs that are read if nothing else is checked.
const SURVEY: (usize, usize) = (160, 80);

/// In which direction the camera of a drive moves, compared with its mount, from its own images. Reads up to 160 of them.
///
/// # Errors
/// [`NoHeading`] if too few of them were taken driving straight ahead.
pub fn heading(dataset: &Dataset) -> Result<Heading, NoHeading> {
    let survey = Survey::sized(dataset, SURVEY);
    measure(&epipolar::pairs(&survey))
}

fn measure(pairs: &[EpipolarPair]) -> Result<Heading, NoHeading> {
    let straight: Vec<&EpipolarPair> = pairs
        .iter()
        .filter(|p| p.vehicle_yaw_rate().abs() < MOST_TURN && p.speed_mps > LEAST_MPS)
        .collect();
    if straight.len() < LEAST_PAIRS {
        return Err(NoHeading {
            straight: straight.len(),
            needed: LEAST_PAIRS,
        });
    }
    let thin = straight.len().div_ceil(MOST_PAIRS);
    let straight: Vec<&EpipolarPair> = straight.into_iter().step_by(thin).collect();
    let parts: Vec<Vector2<f64>> = straight
        .chunks(straight.len().div_ceil(PARTS))
        .map(|part| heading_error(part, YAW))
        .collect();
    let off = heading_error(&straight, YAW);
    let n = parts.len() as f64;
    let spread = |axis: usize| {
        let square: f64 = parts.iter().map(|p| (p[axis] - off[axis]).powi(2)).sum();
        (square / (n * (n - 1.0).max(1.0))).sqrt()
    };
    Ok(Heading {
        off,
        std_error: Vector2::new(spread(0), spread(1)),
    })
}

pub(super) fn check(survey: &Survey<'_>, pairs: &[EpipolarPair]) -> Outcome {
    let found = match measure(pairs) {
        Ok(found) => found,
        Err(why) => return Outcome::skipped("heading", CameraSkip::from(why)),
    };
    let k = &survey.dataset.intrinsics(0);
    let mut outcome = Outcome::new("heading");
    let axes = [
        (
            "pitch of the direction of travel",
            0,
            k.fy,
            HeadingAngle::Pitch,
        ),
        ("yaw of the direction of travel", 1, k.fx, HeadingAngle::Yaw),
    ];
    let mut unsure = Vec::new();
    for (quantity, axis, focal, angle) in axes {
        let off_deg = found.off[axis].to_degrees();
        let std_error_deg = found.std_error[axis].to_degrees();
        if std_error_deg > SURE_DEG {
            unsure.push(UnsureHeading {
                angle,
                off_deg,
                std_error_deg,
            });
            continue;
        }
        let limit = WARN_DEG.max(3.0 * std_error_deg);
        let severity = if off_deg.abs() > ERROR_DEG {
            Severity::Error
        } else {
            Severity::Warning
        };
        let figure = Figure::new(quantity, off_deg, "degrees", Limit::Within(-limit, limit));
        outcome.judge(severity, figure, || {
            let pixels = focal * found.off[axis].tan();
            CameraReason::Heading {
                angle,
                off_deg,
                std_error_deg,
                // v grows downward, the angle upward.
                centre_by_px: if axis == 0 { -pixels } else { pixels },
            }
        });
    }
    if outcome.measured.is_empty() {
        outcome.skipped = Some(CameraSkip::Unsure(unsure).into());
    }
    outcome
}
