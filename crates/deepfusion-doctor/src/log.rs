//! A log of speeds on its own, before it is combined with a video: what it can be used for, what is missing, and what to do.

use super::finding::{Figure, Limit, Outcome, Severity, median};
use super::reason::{LogReason, MOST_MPS};
use super::skip::LogSkip;
use super::{Diagnosis, opening};
use deepfusion_data::{Dataset, DatasetKind, Error as DataError};
use deepfusion_logs::{Clock, DriveLog, Error, ReadOptions, may_hold_log, read};
use std::path::Path;

/// File name endings that are examined as logs if they are not recordings.
const ENDINGS: [&str; 8] = ["gpx", "nmea", "csv", "tsv", "txt", "asc", "blf", "log"];
/// Rate of speeds below which a car's starts and stops are lost between two of them, in 1/s.
const LEAST_HZ: f64 = 0.9;
/// Longest gap that is bridged without being asked, in seconds.
const MOST_GAP_S: f64 = 3.5;
/// Nothing is learned from a pair below this speed, in m/s.
const MOVING_MPS: f64 = 0.5;
/// Least share of the time in which the vehicle should move, in percent.
const LEAST_MOVING: f64 = 20.0;
/// A distance's standard deviation at which its pair has half the weight in training, in percent.
const MOST_SIGMA: f64 = 5.0;

/// Whether a path is a log of speeds and not a recording: a file with such a name, or a phone app's export.
#[must_use]
pub fn is_log(path: &Path) -> bool {
    let ending = path.extension().unwrap_or_default().to_string_lossy();
    let named = ENDINGS.contains(&ending.to_ascii_lowercase().as_str());
    let is_one = (path.is_file() && named) || path.join("Location.csv").is_file();
    is_one
        && matches!(
            Dataset::kind_at(path),
            Err(DataError::UnknownLayout { .. } | DataError::FolderOfRecordings { .. })
        )
}

/// Examines a log on its own. One that cannot be read is a finding, not an error.
#[must_use]
pub fn doctor_log(path: &Path, options: &ReadOptions) -> Diagnosis {
    let recording = match read(path, options) {
        Ok(log) => outcomes(path, &log),
        Err(error) => {
            let why = LogReason::Unreadable(error.into());
            vec![opening::failed(why.into())]
        }
    };
    Diagnosis {
        recording,
        drives: Vec::new(),
    }
}

/// Checks of the log that a GoPro's video holds beside its pictures; empty if it holds none.
pub(super) fn within(path: &Path) -> Vec<Outcome> {
    let is_video = may_hold_log(path)
        && path.is_file()
        && Dataset::kind_at(path).is_ok_and(|kind| kind == DatasetKind::Video);
    match is_video.then(|| read(path, &ReadOptions::default())) {
        Some(Ok(log)) => outcomes(path, &log),
        // A camera's own track without a fix is reported; a video from another camera is not.
        Some(Err(Error::NoGps { why, .. })) => {
            let mut outcome = Outcome::new("log");
            outcome.find(Severity::Warning, None, LogReason::NoSpeed(why));
            vec![outcome]
        }
        _ => Vec::new(),
    }
}

/// The outcomes of all checks.
fn outcomes(path: &Path, log: &DriveLog) -> Vec<Outcome> {
    vec![
        opened(path, log),
        rate(log),
        gaps(log),
        moving(log),
        uncertainty(log),
        turns(log),
        clock(log),
    ]
}

/// Reports what the log is, and what is still needed.
fn opened(path: &Path, log: &DriveLog) -> Outcome {
    let mut outcome = Outcome::new("log");
    outcome.find(
        Severity::Note,
        None,
        LogReason::Holds {
            log: path.to_owned(),
            format: log.format,
            speeds: log.speeds.len(),
            yaw_rates: log.yaw_rates.len(),
            notes: log.notes.clone(),
        },
    );
    outcome
}

/// Times between neighbouring speeds, in seconds.
fn steps(log: &DriveLog) -> Vec<f64> {
    let step = |pair: &[deepfusion_logs::Speed]| (pair[1].ns - pair[0].ns) as f64 * 1e-9;
    log.speeds.windows(2).map(step).collect()
}

fn rate(log: &DriveLog) -> Outcome {
    let mut outcome = Outcome::new("log-rate");
    let hz = median(steps(log)).recip();
    let figure = Figure::new("speeds", hz, "/s", Limit::AtLeast(LEAST_HZ));
    outcome.judge(Severity::Warning, figure, || {
        let every_s = hz.recip();
        LogReason::Sparse { every_s }
    });
    outcome
}

fn gaps(log: &DriveLog) -> Outcome {
    let mut outcome = Outcome::new("log-gaps");
    let longest = steps(log).into_iter().fold(0.0, f64::max);
    let figure = Figure::new("longest gap", longest, "s", Limit::AtMost(MOST_GAP_S));
    outcome.judge(Severity::Warning, figure, || {
        let longest_s = longest;
        LogReason::Gap { longest_s }
    });
    outcome
}

fn moving(log: &DriveLog) -> Outcome {
    let mut outcome = Outcome::new("log-speed");
    let fastest = log.speeds.iter().map(|s| s.mps.abs()).fold(0.0, f64::max);
    let figure = Figure::new("fastest", fastest, "m/s", Limit::AtMost(MOST_MPS));
    outcome.judge(Severity::Error, figure, || {
        let fastest_mps = fastest;
        LogReason::TooFast { fastest_mps }
    });
    let moving = log.speeds.iter().filter(|s| s.mps.abs() > MOVING_MPS);
    let share = 100.0 * moving.count() as f64 / log.speeds.len().max(1) as f64;
    let figure = Figure::new("time in motion", share, "%", Limit::AtLeast(LEAST_MOVING));
    let severity = if share == 0.0 {
        Severity::Error
    } else {
        Severity::Warning
    };
    outcome.judge(severity, figure, || {
        let moving_percent = share;
        LogReason::Standing { moving_percent }
    });
    outcome
}

/// How accurate the speeds are, and what that means for training.
fn uncertainty(log: &DriveLog) -> Outcome {
    let moving = log.speeds.iter().filter(|s| s.mps.abs() > MOVING_MPS);
    let shares: Vec<f64> = moving
        .filter_map(|s| Some(100.0 * s.sigma_mps? / s.mps.abs()))
        .collect();
    if shares.is_empty() {
        return Outcome::skipped("log-sure", LogSkip::NoDeviation);
    }
    let mut outcome = Outcome::new("log-sure");
    let share = median(shares);
    let figure = Figure::new(
        "standard deviation of a speed, relative to it",
        share,
        "%",
        Limit::AtMost(MOST_SIGMA),
    );
    outcome.judge(Severity::Warning, figure, || {
        let sigma_percent = share;
        LogReason::Unsure { sigma_percent }
    });
    outcome
}

fn turns(log: &DriveLog) -> Outcome {
    let mut outcome = Outcome::new("log-turns");
    if !log.yaw_rates.is_empty() {
        let count = log.yaw_rates.len() as f64;
        let figure = Figure::new("yaw rates", count, "", Limit::AtLeast(1.0));
        outcome.measured.push(figure);
        return outcome;
    }
    let what = if log.course_rates.is_empty() {
        LogReason::NoTurns
    } else {
        LogReason::CourseAlone
    };
    outcome.find(Severity::Note, None, what);
    outcome
}

fn clock(log: &DriveLog) -> Outcome {
    let mut outcome = Outcome::new("log-clock");
    let (severity, what) = match log.clock {
        // The camera wrote it itself.
        Clock::Video => return Outcome::skipped("log-clock", LogSkip::OwnClock),
        Clock::Date => (Severity::Note, LogReason::Dates),
        Clock::LocalDate => (Severity::Warning, LogReason::LocalDates),
        Clock::TimeOfDay | Clock::Free => (Severity::Warning, LogReason::NoDates),
    };
    outcome.find(severity, None, what);
    outcome
}
