//! Rates, gaps and lost frames, from the frames' numbers and time stamps; and times at which the vehicle's motion is not
//! known, from its own time stamps.

use super::finding::{Figure, Limit, Outcome, Severity, median};
use super::reason::FramesReason;
use super::skip::FramesSkip;
use deepfusion_data::Dataset;

/// Share of frames that may be missing, percent: none are in KITTI's and the simulator's drives.
const MOST_LOST: f64 = 1.0;
/// Share of the time between frames at which the motion may be unknown, percent. Sensors start and end some frames apart.
const MOST_UNKNOWN: f64 = 2.0;
/// Intervals longer than this many usual ones are gaps.
const GAP: f64 = 1.5;

pub(super) fn check(dataset: &Dataset) -> Outcome {
    let mut outcome = Outcome::new("timing");
    let frames = dataset.frames();
    let steps: Vec<(u64, f64, u64)> = frames
        .windows(2)
        .filter_map(|w| {
            let apart = w[1].time_s? - w[0].time_s?;
            Some((w[1].number, apart, w[1].number - w[0].number))
        })
        .collect();
    if steps.is_empty() {
        return Outcome::skipped("timing", FramesSkip::NoTimes);
    }
    for (number, apart, _) in steps.iter().filter(|(_, apart, _)| *apart <= 0.0) {
        outcome.find(
            Severity::Error,
            Some(*number),
            FramesReason::Backwards { by_s: -apart },
        );
    }
    let usual = median(
        steps
            .iter()
            .map(|(_, apart, n)| apart / *n as f64)
            .collect(),
    );
    // A missing number is a missing frame; if the numbers are consecutive, the time shows it.
    let lost_in = |apart: f64, numbers: u64| {
        let by_time = if apart > GAP * usual * numbers as f64 {
            (apart / usual).round() - numbers as f64
        } else {
            0.0
        };
        numbers as f64 - 1.0 + by_time.max(0.0)
    };
    let lost: f64 = steps.iter().map(|(_, apart, n)| lost_in(*apart, *n)).sum();
    let first = steps.iter().find(|(_, apart, n)| lost_in(*apart, *n) > 0.0);
    let share = 100.0 * lost / (lost + frames.len() as f64);
    let figure = Figure::new("lost frames", share, "%", Limit::AtMost(MOST_LOST));
    let first = first.map(|(number, _, _)| *number);
    outcome.judge_at(Severity::Warning, first, figure, || FramesReason::Lost {
        lost: lost as usize,
        rate_hz: 1.0 / usual,
        first: first.unwrap_or(0),
    });
    unknown_motion(dataset, &mut outcome);
    outcome
}

/// No pair can train where the speed has gaps: motion is not interpolated across them.
fn unknown_motion(dataset: &Dataset, outcome: &mut Outcome) {
    let Some(track) = dataset.track() else { return };
    // For each pair: its first frame's number, its duration, and whether the motion is known.
    let pairs = dataset.frames().windows(2).filter_map(|pair| {
        let times = pair[0].time_s.zip(pair[1].time_s);
        let (from_s, to_s) = times.filter(|(from_s, to_s)| to_s > from_s)?;
        let known = track.motion(from_s, to_s).is_some();
        Some((pair[0].number, to_s - from_s, known))
    });
    let pairs: Vec<(u64, f64, bool)> = pairs.collect();
    let all: f64 = pairs.iter().map(|(_, seconds, _)| seconds).sum();
    if all <= 0.0 {
        return;
    }
    let is_unknown = |(_, _, known): &&(u64, f64, bool)| !known;
    let seconds = |(_, seconds, _): &(u64, f64, bool)| *seconds;
    let unknown_s: f64 = pairs.iter().filter(is_unknown).map(seconds).sum();
    let first = pairs.iter().find(is_unknown).map(|(number, _, _)| *number);
    let gaps = pairs.chunk_by(|a, b| a.2 == b.2).filter(|run| !run[0].2);
    let stretches = gaps.count();
    let before_s: f64 = pairs.iter().take_while(is_unknown).map(seconds).sum();
    let after_s: f64 = pairs.iter().rev().take_while(is_unknown).map(seconds).sum();
    let is_beside = stretches == usize::from(before_s > 0.0) + usize::from(after_s > 0.0);
    let share = 100.0 * unknown_s / all;
    let figure = Figure::new(
        "time without a known motion",
        share,
        "%",
        Limit::AtMost(MOST_UNKNOWN),
    );
    outcome.judge_at(Severity::Warning, first, figure, || {
        if is_beside {
            FramesReason::BesideLog { before_s, after_s }
        } else {
            FramesReason::UnknownMotion {
                unknown_s,
                stretches,
                first: first.unwrap_or(0),
            }
        }
    });
}
