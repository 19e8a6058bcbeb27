//! What is wrong with a log of speeds by itself, or is to be known of it.

use crate::shared_error::SharedError;
use deepfusion_hint::{Hint, count_of};
use deepfusion_logs::{Error, Format, LogNote, NoGps};
use std::path::PathBuf;

/// What is wrong with a log of speeds by itself, or is to be known of it.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum LogReason {
    /// It cannot be read.
    #[error(transparent)]
    Unreadable(SharedError<Error>),
    /// The track within a camera's video has no speed.
    #[error("the camera's own log has no speed: {0}")]
    NoSpeed(NoGps),
    /// What it holds.
    #[error(
        "{format} with {} and {}: {}",
        count_of(*speeds, "speed"),
        count_of(*yaw_rates, "yaw rate"),
        together(notes)
    )]
    Holds {
        /// The log.
        log: PathBuf,
        /// What kind of log it is.
        format: Format,
        /// How many speeds it has.
        speeds: usize,
        /// How many yaw rates.
        yaw_rates: usize,
        /// How it was understood.
        notes: Vec<LogNote>,
    },
    /// Its speeds are far apart in time.
    #[error("a speed every {every_s:.1} s: starts and stops lie between them")]
    Sparse {
        /// How far, seconds.
        every_s: f64,
    },
    /// At a time it has no speeds.
    #[error("{longest_s:.1} s without a speed: frames of that time are not used")]
    Gap {
        /// For how long at most, seconds.
        longest_s: f64,
    },
    /// No road vehicle is as fast.
    #[error(
        "{fastest_mps:.0} m/s are {:.0} km/h: the unit is another one, and every depth would be scaled by it",
        3.6 * fastest_mps
    )]
    TooFast {
        /// Its highest speed, m/s.
        fastest_mps: f64,
    },
    /// The vehicle stands most of the time.
    #[error(
        "the vehicle moves in {moving_percent:.0} % of the log: nothing is learned from the rest"
    )]
    Standing {
        /// How much of the time it moves.
        moving_percent: f64,
    },
    /// Its speeds are unsure.
    #[error(
        "expect distances, and with them a short drive's scale, within ±{sigma_percent:.0} %: such pairs weigh less in training, above 20 % nothing"
    )]
    Unsure {
        /// A speed's standard deviation, of the speed.
        sigma_percent: f64,
    },
    /// Positions alone say how the vehicle turned.
    #[error(
        "turns are known from positions alone: enough to compare the clocks on a few minutes with bends, not for the vehicle's own poses"
    )]
    CourseAlone,
    /// Nothing says how the vehicle turned.
    #[error(
        "nothing says how the vehicle turned: the vehicle's own poses cannot train, and clocks are compared by changes of speed alone"
    )]
    NoTurns,
    /// Its times are dates.
    #[error(
        "dates in UTC: the video begins when its recorder says that it was made, to a second or so"
    )]
    Dates,
    /// Its times are dates of an unknown zone.
    #[error("dates without a zone, taken for UTC: hours off where they are local")]
    LocalDates,
    /// Its times are no dates.
    #[error(
        "times that are no dates: nothing says when the video began, unless the log began with it"
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
                "switch the camera's GPS on and wait for its fix; or bring another log beside the video"
            }
            Self::Holds { log, format, .. } => {
                // A GoPro's log is in its video.
                let beside = match format {
                    Format::Gpmf => "",
                    _ => " with its video",
                };
                let log = log.display();
                return format!(
                    "make a drive of {log}{beside} and the camera; then examine the drive"
                );
            }
            Self::Sparse { .. } => "log at 1 Hz or more; an OBD reader or CAN gives ten a second",
            Self::Gap { .. } => {
                "max_gap_s in dataset.toml bridges it in a straight line, where the vehicle did not stop in between"
            }
            Self::TooFast { .. } => "say the unit of speed (m/s, km/h, mph, knots)",
            Self::Standing { .. } => "log a drive",
            Self::Unsure { .. } => {
                "drive faster or longer, or log the vehicle's own speed: OBD, CAN"
            }
            Self::CourseAlone | Self::NoTurns => {
                "poses by the network or by the distance driven need no turns; a second log with a gyroscope brings them"
            }
            Self::Dates => "pictures and speeds show what is left between the clocks",
            Self::LocalDates => {
                "say the log's time zone; pictures and speeds show what is left between the clocks"
            }
            Self::NoDates => {
                "say when the first frame was taken, on the log's clock; pictures and speeds show what is left between the clocks"
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
    fn what_a_log_holds_is_said_with_its_notes() {
        let notes: Vec<LogNote> = vec![
            TableNote::HeaderAgain { more: 1 }.into(),
            TableNote::HeaderAgain { more: 2 }.into(),
        ];
        let said = [notes[0].to_string(), notes[1].to_string()].join("; ");
        let holds = LogReason::Holds {
            log: "drive.csv".into(),
            format: Format::Table,
            speeds: 13,
            yaw_rates: 1,
            notes,
        };
        assert_eq!(
            holds.to_string(),
            format!("table with 13 speeds and 1 yaw rate: {said}")
        );
        assert_eq!(
            holds.hint(),
            "make a drive of drive.csv with its video and the camera; then examine the drive"
        );
    }

    #[test]
    fn what_is_wrong_with_a_log_is_said() {
        for (reason, said) in [
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
                "12.3 s without a speed: frames of that time are not used",
            ),
            (
                LogReason::TooFast { fastest_mps: 99.0 },
                "99 m/s are 356 km/h: the unit is another one, and every depth would be scaled by it",
            ),
            (
                LogReason::Standing {
                    moving_percent: 12.4,
                },
                "the vehicle moves in 12 % of the log: nothing is learned from the rest",
            ),
            (
                LogReason::Unsure { sigma_percent: 8.2 },
                "expect distances, and with them a short drive's scale, within ±8 %: such pairs weigh less in training, above 20 % nothing",
            ),
            (
                LogReason::CourseAlone,
                "turns are known from positions alone: enough to compare the clocks on a few minutes with bends, not for the vehicle's own \
                 poses",
            ),
            (
                LogReason::NoTurns,
                "nothing says how the vehicle turned: the vehicle's own poses cannot train, and clocks are compared by changes of speed alone",
            ),
            (
                LogReason::Dates,
                "dates in UTC: the video begins when its recorder says that it was made, to a second or so",
            ),
            (
                LogReason::NoDates,
                "times that are no dates: nothing says when the video began, unless the log began with it",
            ),
        ] {
            assert_eq!(reason.to_string(), said);
        }
    }
}
