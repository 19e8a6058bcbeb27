//! Brightness: jumps from frame to frame, darkness, whiteness. View synthesis compares colours.

use super::finding::{Figure, Limit, Outcome, Severity, median};
use super::reason::PicturesReason;
use super::skip::PicturesSkip;
use super::survey::Survey;

/// A change of the mean grey level by more than this share is a jump of the exposure, not a change of the scene.
const JUMP: f64 = 0.12;
/// Share of neighbours that may jump, percent.
const MOST_JUMPS: f64 = 2.0;
/// Median share of a picture that may be almost black or almost white, percent.
const MOST_DARK: f64 = 60.0;
const MOST_WHITE: f64 = 40.0;
/// Added to grey levels before taking ratios: a lamp passing in the dark is not a jump.
const FLOOR: f64 = 10.0;

pub(super) fn check(survey: &Survey<'_>) -> Outcome {
    if survey.frames.is_empty() {
        return Outcome::skipped("exposure", PicturesSkip::NoImage);
    }
    let mut outcome = Outcome::new("exposure");
    let (mut neighbours, mut jumps) = (0_u32, Vec::new());
    for (a, b) in survey.neighbours() {
        neighbours += 1;
        let ratio = (b.quality.mean + FLOOR) / (a.quality.mean + FLOOR);
        if ratio.ln().abs() > JUMP.ln_1p() {
            jumps.push((b.number, ratio));
        }
    }
    if neighbours > 0 {
        let share = 100.0 * jumps.len() as f64 / f64::from(neighbours);
        let figure = Figure::new(
            "neighbours that jump in brightness",
            share,
            "%",
            Limit::AtMost(MOST_JUMPS),
        );
        let first = jumps.first().map(|jump| jump.0);
        outcome.judge_at(Severity::Warning, first, figure, || {
            let (first, first_ratio) = jumps[0];
            PicturesReason::BrightnessJumps {
                jumps: jumps.len(),
                neighbours,
                more_than: JUMP,
                first,
                first_ratio,
            }
        });
    }
    let typical = |of: fn(&super::image_quality::ImageQuality) -> f64| {
        100.0 * median(survey.frames.iter().map(|f| of(&f.quality)).collect())
    };
    let dark = Figure::new(
        "black pixels",
        typical(|l| l.dark),
        "%",
        Limit::AtMost(MOST_DARK),
    );
    outcome.judge(Severity::Warning, dark, || PicturesReason::Dark);
    let white = Figure::new(
        "white pixels",
        typical(|l| l.white),
        "%",
        Limit::AtMost(MOST_WHITE),
    );
    outcome.judge(Severity::Warning, white, || PicturesReason::White);
    outcome
}
