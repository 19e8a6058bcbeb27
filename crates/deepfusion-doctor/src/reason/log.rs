//! What is wrong with a log of speeds on its own, or has to be known about it.

use crate::shared_error::SharedError;
use deepfusion_hint::{Hint, count_of};
use deepfusion_logs::{Error, Format, LogNote, NoGps};
use std::path::PathBuf;

/// What is wrong with a log of speeds on its own, or has to be known about it.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum LogReason {
    /// The log cannot be read.
    #[error(transparent)]
    Unreadable(SharedError<Error>),
    /// The track within a camera's video has no speed.
    #[error("the camera's own log has no speed: {0}")]
    NoSpeed(NoGps),
    /// What the log holds.
    #[error(
        "{format} with {} and {}: {}",
        count_of(*speeds, "speed"),
        count_of(*yaw_rates, "yaw rate"),
        together(notes)
    )]
    Holds {
        /// Path of the log.
        log: PathBuf,
        /// Format of the log.
        format: Format,
        /// Number of speeds.
        speeds: usize,
        /// Number of yaw rates.
        yaw_rates: usize,
        /// How its columns and values were interpreted.
        notes: Vec<LogNote>,
    },
    /// The speeds are far apart in time.
    #[error("a speed every {every_s:.1} s: starts and stops lie between them")]
    Sparse {
        /// Time between two speeds, seconds.
        every_s: f64,
    },
    /// The log has a gap in its speeds.
    #[error("{longest_s:.1} s without a speed: frames in that time are not used")]
    Gap {
        /// Length of the longest gap, seconds.
        longest_s: f64,
    },
    /// A speed is higher than a road vehicle's.
    #[error(
        "{fastest_mps:.0} m/s is {:.0} km/h: the unit is wrong, and every depth would be wrong by the same factor",
        3.6 * fastest_mps
    )]
    TooFast {
        /// The highest speed, m/s.
        fastest_mps: f64,
    },
    /// The vehicle stands most of the time.
    #[error(
        "the vehicle moves in {moving_percent:.0} % of the log: nothing is learned from the rest"
    )]
    Standing {
        /// Share of the time in which it moves, percent.
        moving_percent: f64,
    },
    /// The speeds are uncertain.
    #[error(
        "distances, and with them a short drive's scale, are accurate to ±{sigma_percent:.0} %: such pairs get less weight in training, and none above 20 %"
    )]
    Unsure {
        /// Standard deviation of a speed, percent of the speed.
        sigma_percent: f64,
    },
    /// Turns are known from positions alone.
    #[error(
        "turns are known from positions alone: enough to compare the clocks over a few minutes with bends, but not for the vehicle's own poses"
    )]
    CourseAlone,
    /// No turns were recorded.
    #[error(
        "no turns were recorded: training cannot use the vehicle's own poses, and clocks are compared by changes of speed alone"
    )]
    NoTurns,
    /// The times are dates in UTC.
    #[error(
        "the times are dates in UTC: the video's start is the creation time that its recorder wrote, accurate to a second or so"
    )]
    Dates,
    /// The times are dates in an unknown time zone.
    #[error("the times are dates without a time zone, taken as UTC: hours off if they are local")]
    LocalDates,
    /// The times are not dates.
    #[error(
        "the times are not dates: when the video began is unknown, unless the log began with it"
    )]
    NoDates,
}

impl LogReason {
    /// What to do about it.
    pub(super) fn hint(&self) -> String {
        let text = match self {
            Self::Unreadable(error) => {
                let hint = error.hint().unwrap_or_else(|| super::CORRECT.to_owned());
                return match error.error() {
                    Error::Column { .. } => format!("{hint}, and the speed's unit"),
                    _ => hint,
                };
            }
            Self::NoSpeed(_) => {
                "switch on the camera's GPS and wait for a fix, or record another log with the video"
            }
            Self::Holds { log, format, .. } => {
                // A GoPro's log is in its video.
                let beside = match format {
                    Format::Gpmf => "",
                    _ => " with its video",
                };
                let log = log.display();
                return format!(
                    "make a drive from {log}{beside} and the camera, then examine the drive"
                );
            }
            Self::Sparse { .. } => "log at 1 Hz or more; OBD readers and CAN give about 10 Hz",
            Self::Gap { .. } => {
                "if the vehicle did not stop in between, set max_gap_s in dataset.toml to interpolate over it"
            }
            Self::TooFast { .. } => "give the unit of speed (m/s, km/h, mph, knots)",
            Self::Standing { .. } => {
                "record while driving, or choose another column if this is not the speed"
            }
            Self::Unsure { .. } => {
                "drive faster or longer, or log the vehicle's own speed: OBD, CAN"
            }
            Self::CourseAlone | Self::NoTurns => {
                "use poses from the network or the distance driven, which need no turns, or add a second log with a gyroscope"
            }
            Self::Dates => {
                "nothing to do; pictures and speeds show what remains of the clocks' offset"
            }
            Self::LocalDates => {
                "give the log's time zone; pictures and speeds show what remains of the clocks' offset"
            }
            Self::NoDates => {
                "give the time of the first frame on the log's clock; pictures and speeds show what remains of the clocks' offset"
            }
        };
        text.to_owned()
    }
}

fn together(notes: &[LogNote]) -> String {
    let notes: Vec<String> = notes.iter().map(LogNote::to_string).collect();
    notes.join("; ")
}

#[cfg(test)]
mod tests {
    use super::*;
    use deepfusion_logs::TableNote;

    #[test]
    fn the_contents_of_a_log_are_printed_with_its_notes() {
        let notes: Vec<LogNote> = vec![
            TableNote::HeaderAgain { more: 1 }.into(),
            TableNote::HeaderAgain { more: 2 }.into(),
        ];
        let message = [notes[0].to_string(), notes[1].to_string()].join("; ");
        let holds = LogReason::Holds {
            log: "drive.csv".into(),
            format: Format::Table,
            speeds: 13,
            yaw_rates: 1,
            notes,
        };
        assert_eq!(
            holds.to_string(),
            format!("table with 13 speeds and 1 yaw rate: {message}")
        );
        assert_eq!(
            holds.hint(),
            "make a drive from drive.csv with its video and the camera, then examine the drive"
        );
    }

    #[test]
    fn log_problems_have_their_messages() {
        for (reason, message) in [
            (
                LogReason::NoSpeed(NoGps::NoFix),
                "the camera's own log has no speed: the camera's GPS never had a fix",
            ),
            (
                LogReason::Sparse { every_s: 5.02 },
                "a speed every 5.0 s: starts and stops lie between them",
            ),
            (
                LogReason::Gap { longest_s: 12.34 },
                "12.3 s without a speed: frames in that time are not used",
            ),
            (
                LogReason::TooFast { fastest_mps: 99.0 },
                "99 m/s is 356 km/h: the unit is wrong, and every depth would be wrong by the same factor",
            ),
            (
                LogReason::Standing {
                    moving_percent: 12.4,
                },
                "the vehicle moves in 12 % of the log: nothing is learned from the rest",
            ),
            (
                LogReason::Unsure { sigma_percent: 8.2 },
                "distances, and with them a short drive's scale, are accurate to ±8 %: such pairs get less weight in training, and none above 20 %",
            ),
            (
                LogReason::CourseAlone,
                "turns are known from positions alone: enough to compare the clocks over a few minutes with bends, but not for the vehicle's own poses",
            ),
            (
                LogReason::NoTurns,
                "no turns were recorded: training cannot use the vehicle's own poses, and clocks are compared by changes of speed alone",
            ),
            (
                LogReason::Dates,
                "the times are dates in UTC: the video's start is the creation time that its recorder wrote, accurate to a second or so",
            ),
            (
                LogReason::NoDates,
                "the times are not dates: when the video began is unknown, unless the log began with it",
            ),
        ] {
            assert_eq!(reason.to_string(), message);
        }
    }
}
