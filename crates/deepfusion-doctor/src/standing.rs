//! How much of the drive stands still.

use super::finding::{Figure, Limit, Outcome, Severity};
use super::reason::FramesReason;
use super::skip::FramesSkip;
use deepfusion_data::Dataset;

/// Slower pairs are not used for training, m/s.
const STANDING_MPS: f64 = 0.5;
/// Share of pairs in which the vehicle may stand, percent. Above it, most of the reading is wasted and counts of epochs mislead.
const MOST: f64 = 25.0;

pub(super) fn check(dataset: &Dataset) -> Outcome {
    let Ok(ego) = dataset.ego() else {
        return Outcome::skipped("standing", FramesSkip::NoSpeeds);
    };
    let frames = dataset.frames();
    let motions = (1..frames.len()).filter(|i| frames[*i].number == frames[*i - 1].number + 1);
    let stands: Vec<(u64, bool)> = motions
        .filter_map(|i| {
            let speed = ego.between(frames, i, i - 1).ok()?.speed_mps;
            Some((frames[i].number, speed < STANDING_MPS))
        })
        .collect();
    if stands.is_empty() {
        return Outcome::skipped("standing", FramesSkip::NoKnownMotion);
    }
    let mut outcome = Outcome::new("standing");
    let standing = stands.iter().filter(|(_, stands)| *stands).count();
    let share = 100.0 * standing as f64 / stands.len() as f64;
    let longest = longest_stretch(&stands);
    let figure = Figure::new("pairs below 0.5 m/s", share, "%", Limit::AtMost(MOST));
    let from = longest.map(|(from, _)| from);
    outcome.judge_at(Severity::Warning, from, figure, || {
        let (from, to) = longest.unwrap_or_default();
        FramesReason::Standing {
            standing,
            pairs: stands.len(),
            from,
            to,
        }
    });
    outcome
}

/// The longest run of standing pairs: the frames before its first and at its last.
fn longest_stretch(stands: &[(u64, bool)]) -> Option<(u64, u64)> {
    let runs = stands.chunk_by(|a, b| a.1 == b.1 && a.0 + 1 == b.0);
    let standing = runs.filter(|run| run[0].1);
    // The first of equally long ones.
    let longest = standing.rev().max_by_key(|run| run.len())?;
    Some((longest[0].0 - 1, longest[longest.len() - 1].0))
}

#[cfg(test)]
mod tests {
    use super::longest_stretch;

    #[test]
    fn the_longest_stretch_is_named_by_its_frames() {
        let pair = |number: u64, stands: bool| (number, stands);
        let stands = [
            pair(1, true),
            pair(2, false),
            pair(3, true),
            pair(4, true),
            pair(5, false),
            // A gap: two runs of one and two.
            pair(8, true),
            pair(10, true),
            pair(11, true),
        ];
        assert_eq!(longest_stretch(&stands), Some((2, 4)));
        assert_eq!(longest_stretch(&stands[5..]), Some((9, 11)));
        assert_eq!(longest_stretch(&stands[1..2]), None);
    }
}
