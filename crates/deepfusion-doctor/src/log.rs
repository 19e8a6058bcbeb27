//! A log of speeds by itself, before it is put beside a video: what it is good for, what is missing, and what to do.

use super::finding::{Figure, Limit, Outcome, Remedy, Severity, median};
use super::{Diagnosis, opening};
use deepfusion_data::{Dataset, DatasetKind, Error as DataError};
use deepfusion_hint::{Hint, count_of};
use deepfusion_logs::{Clock, DriveLog, Error, Format, LogNote, ReadOptions, may_hold_log, read};
use std::path::Path;

/// Names of the files that are looked at as logs where they are no recording.
const ENDINGS: [&str; 8] = ["gpx", "nmea", "csv", "tsv", "txt", "asc", "blf", "log"];
/// The speeds' rate below which a car's starts and stops are lost between two of them, in 1/s.
const LEAST_HZ: f64 = 0.9;
/// Longest gap that is bridged by itself, in seconds.
const MOST_GAP_S: f64 = 3.5;
/// Below it nothing is learned from a pair, in m/s.
const MOVING_MPS: f64 = 0.5;
/// Least share of the time in which the vehicle should move, in percent.
const LEAST_MOVING: f64 = 20.0;
/// No road vehicle is faster, in m/s; km/h taken for m/s are.
const MOST_MPS: f64 = 70.0;
/// A distance's standard deviation at which its pair weighs half in training, in percent.
const MOST_SIGMA: f64 = 5.0;

/// Whether a path is a log of speeds and no recording: a file that is named like one, or a phone app's export.
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

/// Examines a log by itself. One that cannot be read is a finding, not an error.
#[must_use]
pub fn doctor_log(path: &Path, options: &ReadOptions) -> Diagnosis {
    let recording = match read(path, options) {
        Ok(log) => outcomes(path, &log),
        Err(error) => vec![opening::failed(error.to_string(), remedy(&error))],
    };
    Diagnosis {
        recording,
        drives: Vec::new(),
    }
}

/// What a GoPro's video holds beside its pictures; nothing where it holds no log.
pub(super) fn within(path: &Path) -> Vec<Outcome> {
    let is_video = may_hold_log(path)
        && path.is_file()
        && Dataset::kind_at(path).is_ok_and(|kind| kind == DatasetKind::Video);
    match is_video.then(|| read(path, &ReadOptions::default())) {
        Some(Ok(log)) => outcomes(path, &log),
        // The camera's own track without a fix is worth a word; a video of another camera is not.
        Some(Err(Error::NoGps { why, .. })) => {
            let mut outcome = Outcome::new("log");
            outcome.find(
                Severity::Warning,
                None,
                format!("the camera's own log has no speed: {why}"),
                Remedy::OtherLog,
            );
            vec![outcome]
        }
        _ => Vec::new(),
    }
}

/// Check by check.
fn outcomes(path: &Path, log: &DriveLog) -> Vec<Outcome> {
    vec![
        opened(path, log),
        rate(log),
        gaps(log),
        moving(log),
        sure(log),
        turns(log),
        clock(log),
    ]
}

/// What to do about a log that cannot be read.
fn remedy(error: &Error) -> Option<Remedy> {
    match error {
        Error::Signal { .. } => Some(Remedy::Signal),
        Error::Column { .. } => error.hint().map(Remedy::Columns),
        _ => error.hint().map(Remedy::Words),
    }
}

/// What it is, and what it still needs.
fn opened(path: &Path, log: &DriveLog) -> Outcome {
    let mut outcome = Outcome::new("log");
    let notes: Vec<String> = log.notes.iter().map(LogNote::to_string).collect();
    outcome.find(
        Severity::Note,
        None,
        format!(
            "{} with {} and {}: {}",
            log.format,
            count_of(log.speeds.len(), "speed"),
            count_of(log.yaw_rates.len(), "yaw rate"),
            notes.join("; ")
        ),
        Remedy::Import {
            log: path.to_owned(),
            video: log.format != Format::Gpmf,
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
        (
            format!(
                "a speed every {:.1} s: starts and stops lie between them",
                hz.recip()
            ),
            "log at 1 Hz or more; an OBD reader or CAN gives ten a second".into(),
        )
    });
    outcome
}

fn gaps(log: &DriveLog) -> Outcome {
    let mut outcome = Outcome::new("log-gaps");
    let longest = steps(log).into_iter().fold(0.0, f64::max);
    let figure = Figure::new("longest gap", longest, "s", Limit::AtMost(MOST_GAP_S));
    outcome.judge(Severity::Warning, figure, || {
        (
            format!("{longest:.1} s without a speed: frames of that time are not used"),
            "max_gap_s in dataset.toml bridges it in a straight line, where the vehicle did not stop in between".into(),
        )
    });
    outcome
}

fn moving(log: &DriveLog) -> Outcome {
    let mut outcome = Outcome::new("log-speed");
    let fastest = log.speeds.iter().map(|s| s.mps.abs()).fold(0.0, f64::max);
    let figure = Figure::new("fastest", fastest, "m/s", Limit::AtMost(MOST_MPS));
    outcome.judge(Severity::Error, figure, || {
        (
            format!("{fastest:.0} m/s are {:.0} km/h: the unit is another one, and every depth would be scaled by it", 3.6 * fastest),
            Remedy::SpeedUnit,
        )
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
        (
            format!(
                "the vehicle moves in {share:.0} % of the log: nothing is learned from the rest"
            ),
            "log a drive".into(),
        )
    });
    outcome
}

/// How sure the speeds are, and what that costs.
fn sure(log: &DriveLog) -> Outcome {
    let moving = log.speeds.iter().filter(|s| s.mps.abs() > MOVING_MPS);
    let shares: Vec<f64> = moving
        .filter_map(|s| Some(100.0 * s.sigma_mps? / s.mps.abs()))
        .collect();
    if shares.is_empty() {
        return Outcome::skipped("log-sure", "the log does not say how sure its speeds are");
    }
    let mut outcome = Outcome::new("log-sure");
    let share = median(shares);
    let figure = Figure::new(
        "standard deviation of a speed, of the speed",
        share,
        "%",
        Limit::AtMost(MOST_SIGMA),
    );
    outcome.judge(Severity::Warning, figure, || {
        (
            format!("expect distances, and with them a short drive's scale, within ±{share:.0} %: such pairs weigh less in training, above 20 % nothing"),
            Remedy::VehicleSpeed,
        )
    });
    outcome
}

fn turns(log: &DriveLog) -> Outcome {
    let mut outcome = Outcome::new("log-turns");
    if !log.yaw_rates.is_empty() {
        let count = log.yaw_rates.len() as f64;
        outcome.judge(
            Severity::Note,
            Figure::new("yaw rates", count, "", Limit::AtLeast(1.0)),
            || (String::new(), "".into()),
        );
        return outcome;
    }
    let from_positions = !log.course_rates.is_empty();
    let what = if from_positions {
        "turns are known from positions alone: enough to compare the clocks on a few minutes with bends, not for the vehicle's own poses"
    } else {
        "nothing says how the vehicle turned: the vehicle's own poses cannot train, and clocks are compared by changes of speed alone"
    };
    let remedy = Remedy::Turns { from_positions };
    outcome.find(Severity::Note, None, what.into(), remedy);
    outcome
}

fn clock(log: &DriveLog) -> Outcome {
    let mut outcome = Outcome::new("log-clock");
    let (severity, what) = match log.clock {
        // The camera wrote it itself.
        Clock::Video => return Outcome::skipped("log-clock", "the camera's own clock"),
        Clock::Date => (
            Severity::Note,
            "dates in UTC: the video begins when its recorder says that it was made, to a second or so",
        ),
        Clock::LocalDate => (
            Severity::Warning,
            "dates without a zone, taken for UTC: hours off where they are local",
        ),
        Clock::TimeOfDay | Clock::Free => (
            Severity::Warning,
            "times that are no dates: nothing says when the video began, unless the log began with it",
        ),
    };
    let remedy = Remedy::StartOfVideo(log.clock);
    outcome.find(severity, None, what.into(), remedy);
    outcome
}
