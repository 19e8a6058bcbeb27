use crate::problem::{BytesProblem, LineField, LineProblem, SignalProblem, SpeedProblem};
use deepfusion_fs::FileError;
use deepfusion_hint::Hint;
use std::path::{Path, PathBuf};

/// Why a log cannot be read or used.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum Error {
    /// A file could not be opened or read.
    #[error(transparent)]
    File(#[from] FileError),
    /// A line cannot be read.
    #[error("{}:{line}: {}{problem}", path.display(), place(field))]
    Line {
        /// Path of the file.
        path: PathBuf,
        /// The line, counted from 1.
        line: u64,
        /// The column, element or sentence.
        field: LineField,
        /// Why it cannot be read.
        problem: LineProblem,
    },
    /// Bytes of a binary log cannot be read.
    #[error("{}: byte {offset}: {field}: {problem}", path.display())]
    Bytes {
        /// Path of the file.
        path: PathBuf,
        /// Position in the file, counted from 0.
        offset: u64,
        /// The box, key or object.
        field: &'static str,
        /// Why it cannot be read.
        problem: BytesProblem,
    },
    /// The column of times or speeds is missing or not known.
    #[error("{}: {problem}; {}", path.display(), in_words(columns))]
    Column {
        /// Path of the file.
        path: PathBuf,
        /// What is wrong with the choice of a column.
        problem: ColumnProblem,
        /// The headers of all columns.
        columns: Vec<String>,
    },
    /// The log is of a kind without speeds, or has none that is known.
    #[error("{}: {problem}", path.display())]
    NoSpeed {
        /// Path of the file or folder.
        path: PathBuf,
        /// Why it has no speed.
        problem: SpeedProblem,
    },
    /// A camera's own track has no speed.
    #[error("{}: {why}", path.display())]
    NoGps {
        /// Path of the video.
        path: PathBuf,
        /// Why it has no speed.
        why: NoGps,
    },
    /// A CAN trace without a signal to decode.
    #[error("{}: {problem}", path.display())]
    Signal {
        /// Path of the trace.
        path: PathBuf,
        /// What is missing.
        problem: SignalProblem,
    },
    /// Nothing connects the log's clock with the video's.
    #[error("the log's times begin at {}, and it is not known when the video began on that clock", begun(*first_ns, *time_of_day))]
    NoStart {
        /// The log's first time, in nanoseconds.
        first_ns: i64,
        /// Whether its times count from midnight.
        time_of_day: bool,
    },
    /// A file would be overwritten.
    #[error("{}: already exists", path.display())]
    Exists {
        /// Path of the file.
        path: PathBuf,
    },
    /// The clocks of two logs cannot be related.
    #[error("{}: its clock is of a different kind from the first log's", path.display())]
    OtherClock {
        /// Path of the second log.
        path: PathBuf,
    },
    /// A DBC file or one of its signals cannot be used.
    #[error(transparent)]
    Motion(#[from] deepfusion_motion::Error),
}

/// The headers of a table's columns, as part of a sentence.
fn in_words(columns: &[String]) -> String {
    if columns.iter().all(String::is_empty) {
        "the file has no header".into()
    } else {
        format!("its columns: {}", columns.join(", "))
    }
}

/// The part of a line, before a problem; nothing for the whole line.
fn place(field: &LineField) -> String {
    match field {
        LineField::Line => String::new(),
        field => format!("{field}: "),
    }
}

/// Why a camera's own track has no speed.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum NoGps {
    /// The video has no GPS data.
    #[error("its metadata has no GPS data: the GPS was switched off")]
    SwitchedOff,
    /// The video has GPS data without a fix.
    #[error("the camera's GPS never had a fix")]
    NoFix,
}

/// What is wrong with the choice of a column.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum ColumnProblem {
    /// A column that was asked for by name is missing.
    #[error("no column '{0}'")]
    Missing(String),
    /// No column looks like a time.
    #[error("no column looks like a time")]
    NoTime,
    /// No column of numbers looks like a speed, and there are no positions.
    #[error("no column of numbers looks like a speed, and none like latitude and longitude")]
    NoSpeed,
    /// The speed's unit is not known.
    #[error("the unit of the speed in column '{0}' is not known")]
    NoSpeedUnit(String),
    /// The time's unit is not known.
    #[error("the unit of the time in column '{0}' is not known")]
    NoTimeUnit(String),
}

impl Hint for Error {
    fn hint(&self) -> Option<String> {
        let text = match self {
            Self::File(error) => return error.hint(),
            Self::Motion(error) => return error.hint(),
            Self::Line { .. } => "correct the line or delete it, or export the log again",
            Self::Bytes { .. } => "copy the file again from where it was recorded",
            Self::Column { problem, .. } => return problem.hint(),
            Self::NoSpeed { .. } | Self::NoGps { .. } => {
                "give a GPX or NMEA track, a table with a header, a phone's export folder, a GoPro's video or a CAN trace"
            }
            Self::Signal { .. } => "give the DBC file and the speed's signal, as Message.Signal",
            Self::NoStart { .. } => "give the time of the first frame on the log's clock",
            Self::Exists { .. } => "choose another folder, or remove the file",
            Self::OtherClock { .. } => {
                "give one log with both speeds and turns, or the first log alone"
            }
        };
        Some(text.to_owned())
    }
}

impl Hint for NoGps {
    fn hint(&self) -> Option<String> {
        Some("switch on the camera's GPS and wait for a fix, or give another log".into())
    }
}

impl Hint for ColumnProblem {
    fn hint(&self) -> Option<String> {
        let text = match self {
            Self::NoSpeedUnit(_) => {
                "give the unit of speed (m/s, km/h, mph, knots): a wrong one would scale every depth"
            }
            Self::NoTimeUnit(_) => "name the column time_s, time_ms, time_us or time_ns",
            Self::Missing(_) | Self::NoTime | Self::NoSpeed => {
                "name the columns of time and speed as they are in the header"
            }
        };
        Some(text.to_owned())
    }
}

/// A log's first time, as its clock shows it.
fn begun(first_ns: i64, time_of_day: bool) -> String {
    if !time_of_day {
        return format!("{} s on a clock of their own", first_ns as f64 * 1e-9);
    }
    let s = first_ns.div_euclid(1_000_000_000);
    let (hours, minutes) = (s.div_euclid(3600), s.rem_euclid(3600) / 60);
    format!("{hours:02}:{minutes:02}:{:02}", s.rem_euclid(60))
}

/// Result of the crate's functions.
pub type Result<T> = std::result::Result<T, Error>;

impl Error {
    pub(crate) fn file(path: &Path, source: std::io::Error) -> Self {
        FileError::new(path, source).into()
    }
}

/// What is wrong with a line, before the file's name is known.
pub(crate) struct BadLine {
    pub(crate) line: u64,
    pub(crate) field: LineField,
    pub(crate) problem: LineProblem,
}

impl BadLine {
    pub(crate) fn new(
        line: u64,
        field: impl Into<LineField>,
        problem: impl Into<LineProblem>,
    ) -> Self {
        Self {
            line,
            field: field.into(),
            problem: problem.into(),
        }
    }

    pub(crate) fn of(self, path: &Path) -> Error {
        Error::Line {
            path: path.to_owned(),
            line: self.line,
            field: self.field,
            problem: self.problem,
        }
    }
}
