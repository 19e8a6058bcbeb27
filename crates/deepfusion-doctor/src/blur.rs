//! Blurred frames: single ones compared with the drive's usual sharpness, and a whole drive out of focus.

use super::finding::{Figure, Limit, Outcome, Severity, median};
use super::reason::PicturesReason;
use super::skip::PicturesSkip;
use super::survey::Survey;

/// A frame with less than this share of the drive's usual sharpness is blurred.
const BLURRED: f64 = 0.5;
/// Share of blurred frames, percent.
const MOST: f64 = 5.0;
/// Sharpness of a drive in focus: variance of the Laplacian over that at half the image's size.
const LEAST: f64 = 0.06;

pub(super) fn check(survey: &Survey<'_>) -> Outcome {
    let seen = survey.frames.iter();
    let seen: Vec<(u64, f64)> = seen
        .filter_map(|f| Some((f.number, f.quality.sharpness?)))
        .collect();
    if seen.is_empty() {
        return Outcome::skipped("blur", PicturesSkip::NoDetail);
    }
    let mut outcome = Outcome::new("blur");
    let usual = median(seen.iter().map(|s| s.1).collect());
    let overall = Figure::new("sharpness", usual, "", Limit::AtLeast(LEAST));
    outcome.judge(Severity::Warning, overall, || PicturesReason::Soft);
    let blurred: Vec<u64> = seen
        .iter()
        .filter(|(_, sharpness)| *sharpness < BLURRED * usual)
        .map(|(number, _)| *number)
        .collect();
    let share = 100.0 * blurred.len() as f64 / seen.len() as f64;
    let figure = Figure::new("blurred frames", share, "%", Limit::AtMost(MOST));
    let first = blurred.first().copied();
    outcome.judge_at(Severity::Warning, first, figure, || {
        PicturesReason::Blurred {
            blurred: blurred.len(),
            frames: seen.len(),
            first: blurred[0],
        }
    });
    outcome
}
