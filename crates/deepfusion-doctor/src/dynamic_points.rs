//! A topic of dynamic points against the radial velocities of its LiDAR.

use super::finding::{Figure, Limit, Outcome, Severity};
use deepfusion_data::Dataset;
use deepfusion_hint::count_of;

const CHECK: &str = "dynamic-points";
/// Scans looked at.
const MOST_SCANS: usize = 40;
/// Fewer moving points, by either, tell no share.
const LEAST_POINTS: usize = 200;
/// The driver's threshold need not be ours: slow objects may be in one alone.
const LEAST_SHARE: Limit = Limit::AtLeast(0.7);

pub(super) fn check(dataset: &Dataset) -> Outcome {
    let agreement = match dataset.dynamic_agreement(MOST_SCANS) {
        Ok(Some(agreement)) => agreement,
        Ok(None) => {
            let why = "no topic of dynamic points beside a LiDAR with radial velocities";
            return Outcome::skipped(CHECK, why);
        }
        Err(error) => return Outcome::skipped(CHECK, error.to_string()),
    };
    if agreement.listed.max(agreement.fast) < LEAST_POINTS {
        let why = format!("too little moves in {}", count_of(agreement.scans, "scan"));
        return Outcome::skipped(CHECK, why);
    }
    // Where one says that nothing moves, it has none of what the other says.
    let share = |share: f64| if share.is_nan() { 0.0 } else { share };
    let (precision, recall) = (share(agreement.precision()), share(agreement.recall()));
    let mut outcome = Outcome::new(CHECK);
    let figure = Figure::new(
        "share of the dynamic points that move by radial velocity",
        precision,
        "",
        LEAST_SHARE,
    );
    outcome.judge(Severity::Warning, figure, || {
        (
            format!(
                "of {} that the topic of dynamic points lists, {} are in the scans and {} move by their radial velocity",
                count_of(agreement.listed, "point"), agreement.in_scan, agreement.both
            ),
            "topics.dynamic names the topic; its points must be the LiDAR's, in its axes and at its times; lidar.moving_mps may be too high".into(),
        )
    });
    let figure = Figure::new(
        "share of the points that move by radial velocity that are dynamic points",
        recall,
        "",
        LEAST_SHARE,
    );
    outcome.judge(Severity::Warning, figure, || {
        (
            format!(
                "of {} points that move by their radial velocity, the topic of dynamic points lists {}",
                agreement.fast, agreement.both
            ),
            "see lidar.over_ground and lidar.velocity_field; lidar.moving_mps may be lower than the driver's threshold".into(),
        )
    });
    outcome
}
