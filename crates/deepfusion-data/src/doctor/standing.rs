//! How much of the drive stands still.

use super::finding::{Figure, Limit, Outcome, Severity};
use crate::Dataset;

/// Slower pairs do not train (SPEC 3.5), m/s.
const STANDING_MPS: f64 = 0.5;
/// Share of the pairs that may stand, percent. Above, most of the reading and all counts of epochs mislead.
const MOST: f64 = 25.0;

pub(super) fn check(dataset: &Dataset) -> Outcome {
    let Ok(ego) = dataset.ego() else {
        return Outcome::skipped("standing", "the recording has no speeds");
    };
    let frames = dataset.frames();
    let motions = (1..frames.len()).filter(|i| frames[*i].number == frames[*i - 1].number + 1);
    let speeds: Vec<f64> = motions
        .filter_map(|i| Some(ego.between(frames, i, i - 1).ok()?.speed_mps))
        .collect();
    if speeds.is_empty() {
        return Outcome::skipped(
            "standing",
            "no pair of neighbouring frames has a known motion",
        );
    }
    let mut outcome = Outcome::new("standing");
    let standing = speeds.iter().filter(|v| **v < STANDING_MPS).count();
    let share = 100.0 * standing as f64 / speeds.len() as f64;
    let figure = Figure::new("pairs below 0.5 m/s", share, "%", Limit::AtMost(MOST));
    outcome.judge(Severity::Warning, figure, || {
        (
            format!(
                "the vehicle stands in {standing} of {} pairs: they show no parallax and are left out of training",
                speeds.len()
            ),
            "cut the standing parts out, or see whether the speed signal drops out".into(),
        )
    });
    outcome
}
