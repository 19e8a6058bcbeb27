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
    /// A part with a name of its format's: an element, a sentence, or `any` for the line as a whole.
    Named(&'static str),
    /// A column of a table, by its header.
    Column(String),
    /// A column of GnssLogger's `Fix` rows.
    FixColumn(String),
}

impl fmt::Display for LineField {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
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
    /// The file is text of 16 bits a letter.
    #[error("UTF-16 text, save it as UTF-8")]
    Utf16,
    /// The file is no text.
    #[error("not UTF-8 text, and no binary log that is known")]
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
    /// A binary log of Vector's cannot be read.
    #[error(transparent)]
    Blf(#[from] BlfProblem),
}

/// Why a log holds no speed.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum SpeedProblem {
    /// Fewer than two rows have a time and a speed.
    #[error("{} with a time and a speed, at least two are needed", count_of(*rows, "row"))]
    TooFewRows {
        /// How many have.
        rows: usize,
    },
    /// Fewer than two fixes lie near each other in time.
    #[error("{} with a time, at least two in ten seconds are needed", count_of(*fixes, "fix"))]
    TooFewFixes {
        /// How many there are.
        fixes: usize,
    },
    /// A table's column of times is empty.
    #[error("no row below the header has a time")]
    NoTime,
    /// A table with one value a row does not have what was asked for.
    #[error("nothing is called '{name}'; measured are: {}", measured.join(", "))]
    NotMeasured {
        /// The name asked for.
        name: String,
        /// What it has.
        measured: Vec<String>,
    },
    /// A table with one value a row has nothing that is called a speed.
    #[error("nothing measured looks like the vehicle's speed; measured are: {}", measured.join(", "))]
    NoneMeasured {
        /// What it has.
        measured: Vec<String>,
    },
    /// GnssLogger's `Fix` rows lack a column.
    #[error("the Fix rows have no column {column}")]
    NoFixColumn {
        /// The column's name.
        column: &'static str,
    },
    /// A folder has no table of positions.
    #[error("an export folder has one of {}", expected.join(", "))]
    NoLocations {
        /// The names of such tables.
        expected: &'static [&'static str],
    },
    /// A sensor's table lacks an axis.
    #[error("no column of the axis {axis}")]
    NoAxis {
        /// The axis: x, y or z.
        axis: &'static str,
    },
    /// A video has no track of metadata.
    #[error("a video without a track of GoPro's metadata (gpmd)")]
    NoTrack,
    /// No frame of a CAN trace has the signal.
    #[error("{} {signal}", none_carries(*frames))]
    NoFrame {
        /// How many frames it has.
        frames: usize,
        /// The signal's name.
        signal: String,
    },
}

/// That no frame of a trace carries something.
fn none_carries(frames: usize) -> String {
    match frames {
        1 => "its only frame does not carry".to_owned(),
        _ => format!("none of its {frames} frames carries"),
    }
}
