//! Frames that repeat the frame before. Their pair shows no motion although the vehicle moved, and teaches that
//! everything is far away.

use super::finding::{Figure, Limit, Outcome, Severity};
use super::reason::FramesReason;
use super::skip::FramesSkip;
use super::survey::Survey;
use deepfusion_data::Frame;

/// The vehicle certainly moves above this, m/s.
const MOVING_MPS: f64 = 1.0;
/// Share of frames that may repeat the one before while the vehicle moves: none does in an undamaged recording.
const MOST: f64 = 0.0;

pub(super) fn check(survey: &Survey<'_>) -> Outcome {
    let mut outcome = Outcome::new("duplicates");
    let frames = survey.dataset.frames();
    let moving = |a: usize, b: usize| survey.speed_mps(a, b).is_some_and(|v| v > MOVING_MPS);
    let (mut compared, mut repeated) = (0_u32, Vec::new());
    if frames.iter().all(|f| f.image.file().is_some()) {
        for (i, pair) in frames.windows(2).enumerate() {
            if moving(i, i + 1) {
                compared += 1;
                repeated.extend(same_file(&pair[0], &pair[1]).then_some(pair[1].number));
            }
        }
    } else {
        for (a, b) in survey.neighbours() {
            if moving(a.index, b.index) {
                compared += 1;
                repeated.extend((a.small == b.small).then_some(b.number));
            }
        }
    }
    if compared == 0 {
        return Outcome::skipped("duplicates", FramesSkip::NoneInMotion);
    }
    let share = 100.0 * repeated.len() as f64 / f64::from(compared);
    let figure = Figure::new("repeated frames", share, "%", Limit::AtMost(MOST));
    let first = repeated.first().copied();
    outcome.judge_at(Severity::Error, first, figure, || FramesReason::Repeated {
        repeated: repeated.len(),
        frames: compared,
        first: repeated[0],
    });
    outcome
}

/// Whether two files hold the same bytes. Another check reports files that cannot be read.
fn same_file(a: &Frame, b: &Frame) -> bool {
    let (a, b) = (a.image.path(), b.image.path());
    let length = |path: &std::path::Path| std::fs::metadata(path).map(|m| m.len()).ok();
    length(a).is_some()
        && length(a) == length(b)
        && matches!((std::fs::read(a), std::fs::read(b)), (Ok(a), Ok(b)) if a == b)
}
