//! Whether the picture moves enough for depth to be seen.

use super::epipolar::{EpipolarPair, YawTrust};
use super::finding::{Figure, Limit, Outcome, Severity, median};
use super::reason::PicturesReason;
use super::skip::PicturesSkip;
use super::survey::Survey;

/// Width at which networks train, pixels.
const TRAINING_WIDTH: f64 = 640.0;
/// Median movement of the followed points that remains without the turn, pixels a frame at that width.
const LEAST_PX: f64 = 0.1;
/// Pairs in which the vehicle stands are left to another check.
const MOVING_MPS: f64 = 0.5;

pub(super) fn check(survey: &Survey<'_>, pairs: &[EpipolarPair]) -> Outcome {
    let k = &survey.intrinsics;
    let scale = k.fx * TRAINING_WIDTH / f64::from(k.width) / survey.stride as f64;
    let moved: Vec<f64> = pairs
        .iter()
        .filter(|p| p.speed_mps > MOVING_MPS)
        .filter_map(|p| Some(scale * p.turn(&p.direction()?, YawTrust(0.001))?.parallax))
        .collect();
    if moved.is_empty() {
        return Outcome::skipped("parallax", PicturesSkip::NoPoints);
    }
    let mut outcome = Outcome::new("parallax");
    let moved = median(moved);
    let figure = Figure::new(
        "median parallax at 640 pixels' width",
        moved,
        "px a frame",
        Limit::AtLeast(LEAST_PX),
    );
    outcome.judge(Severity::Warning, figure, || PicturesReason::LittleParallax);
    outcome
}
