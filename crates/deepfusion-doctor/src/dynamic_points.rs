//! A topic of dynamic points compared with the radial velocities of its LiDAR.

use super::finding::{Figure, Limit, Outcome, Severity};
use super::reason::MotionReason;
use super::shared_error::SharedError;
use super::skip::MotionSkip;
use deepfusion_data::Dataset;

const CHECK: &str = "dynamic-points";
/// Number of scans examined.
const MOST_SCANS: usize = 40;
/// With fewer dynamic points, according to either source, there is no meaningful share.
const LEAST_POINTS: usize = 200;
/// The driver's threshold may differ from ours: slow objects may be in one source alone.
const LEAST_SHARE: Limit = Limit::AtLeast(0.7);

pub(super) fn check(dataset: &Dataset) -> Outcome {
    let agreement = match dataset.dynamic_agreement(MOST_SCANS) {
        Ok(Some(agreement)) => agreement,
        Ok(None) => return Outcome::skipped(CHECK, MotionSkip::NoDynamicPoints),
        Err(error) => return Outcome::skipped(CHECK, SharedError::from(error)),
    };
    if agreement.listed.max(agreement.fast) < LEAST_POINTS {
        let scans = agreement.scans;
        return Outcome::skipped(CHECK, MotionSkip::LittleDynamic { scans });
    }
    // If one source says that nothing moves, it shares no points with the other.
    let share = |share: f64| if share.is_nan() { 0.0 } else { share };
    let (precision, recall) = (share(agreement.precision()), share(agreement.recall()));
    let mut outcome = Outcome::new(CHECK);
    let figure = Figure::new(
        "share of the dynamic points that move by radial velocity",
        precision,
        "",
        LEAST_SHARE,
    );
    outcome.judge(Severity::Warning, figure, || MotionReason::DynamicAndSlow {
        listed: agreement.listed,
        in_scan: agreement.in_scan,
        fast: agreement.both,
    });
    let figure = Figure::new(
        "share of the points that move by radial velocity that are dynamic points",
        recall,
        "",
        LEAST_SHARE,
    );
    outcome.judge(Severity::Warning, figure, || {
        MotionReason::FastAndUnlisted {
            fast: agreement.fast,
            listed: agreement.both,
        }
    });
    outcome
}
