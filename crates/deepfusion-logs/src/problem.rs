//! What is wrong with a log.

mod blf;
mod can;
mod fixes;
mod gopro;
mod table;

pub use self::blf::BlfProblem;
pub use self::can::{CanFrameProblem, SignalProblem};
pub use self::fixes::{GpxProblem, NmeaProblem};
pub use self::gopro::{GpmfProblem, Mp4Problem};
pub use self::table::TableProblem;

use deepfusion_hint::count_of;
use std::fmt;

/// A part of a line.
#[derive(Debug, Clone, PartialEq, Eq)]
#[non_exhaustive]
pub enum LineField {
    /// The whole line.
    Line,
    /// A part named by the format: an element or a sentence.
    Named(&'static str),
    /// A column of a table, by its header.
    Column(String),
    /// A column of GnssLogger's `Fix` rows.
    FixColumn(String),
}

impl fmt::Display for LineField {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Line => f.write_str("line"),
            Self::Named(name) => f.write_str(name),
            Self::Column(header) => write!(f, "column {header}"),
            Self::FixColumn(name) => write!(f, "Fix, {name}"),
        }
    }
}

impl From<&'static str> for LineField {
    fn from(name: &'static str) -> Self {
        Self::Named(name)
    }
}

/// Why a line cannot be read.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum LineProblem {
    /// The file is UTF-16 text.
    #[error("UTF-16 text: save it as UTF-8")]
    Utf16,
    /// The file is not text.
    #[error("neither UTF-8 text nor a known binary log")]
    NoText,
    /// A row of a table cannot be read.
    #[error(transparent)]
    Table(#[from] TableProblem),
    /// A GPX file cannot be read.
    #[error(transparent)]
    Gpx(#[from] GpxProblem),
    /// A receiver's sentence cannot be read.
    #[error(transparent)]
    Nmea(#[from] NmeaProblem),
    /// A frame of a CAN trace cannot be read.
    #[error(transparent)]
    Frame(#[from] CanFrameProblem),
}

/// Why bytes of a binary log cannot be read.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum BytesProblem {
    /// A video's boxes contradict each other.
    #[error(transparent)]
    Mp4(#[from] Mp4Problem),
    /// GoPro's metadata cannot be read.
    #[error(transparent)]
    Gpmf(#[from] GpmfProblem),
    /// A Vector binary log cannot be read.
    #[error(transparent)]
    Blf(#[from] BlfProblem),
}

/// Why a log has no speed.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum SpeedProblem {
    /// Fewer than two rows have a time and a speed.
    #[error("{} with a time and a speed, expected at least two", count_of(*rows, "row"))]
    TooFewRows {
        /// Number of rows that have both.
        rows: usize,
    },
    /// Fewer than two fixes lie near each other in time.
    #[error("{} with a time, expected at least two within 10 s", count_of(*fixes, "fix"))]
    TooFewFixes {
        /// Number of fixes.
        fixes: usize,
    },
    /// A table's column of times is empty.
    #[error("no row below the header has a time")]
    NoTime,
    /// A table with one value per row does not have the requested quantity.
    #[error("no quantity '{name}'; the file has: {}", measured.join(", "))]
    NotMeasured {
        /// The requested name.
        name: String,
        /// The quantities in the table.
        measured: Vec<String>,
    },
    /// A table with one value per row has no quantity that is called a speed.
    #[error("no quantity looks like the vehicle's speed; the file has: {}", measured.join(", "))]
    NoneMeasured {
        /// The quantities in the table.
        measured: Vec<String>,
    },
    /// GnssLogger's `Fix` rows lack a column.
    #[error("the Fix rows have no column {column}")]
    NoFixColumn {
        /// Name of the column.
        column: &'static str,
    },
    /// A folder has no table of positions.
    #[error("no table of positions; expected one of {}", expected.join(", "))]
    NoLocations {
        /// File names of such tables.
        expected: &'static [&'static str],
    },
    /// A sensor's table lacks an axis.
    #[error("no column for the axis {axis}")]
    NoAxis {
        /// The axis: x, y or z.
        axis: &'static str,
    },
    /// A video has no GoPro metadata track.
    #[error("the video has no GoPro metadata track (gpmd)")]
    NoTrack,
    /// No frame of a CAN trace has the signal.
    #[error("{} {signal}", none_carries(*frames))]
    NoFrame {
        /// Number of frames in the trace.
        frames: usize,
        /// Name of the signal.
        signal: String,
    },
}

/// Beginning of the message that no frame of a trace contains a signal.
fn none_carries(frames: usize) -> String {
    match frames {
        1 => "its only frame does not contain".to_owned(),
        _ => format!("none of its {frames} frames contains"),
    }
}
