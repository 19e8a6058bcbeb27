//! What is wrong with a track of fixes.

use quick_xml::events::attributes::AttrError;

/// Why a GPX file cannot be read.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum GpxProblem {
    /// It is no XML: what the parser said.
    #[error(transparent)]
    Xml(#[from] quick_xml::Error),
    /// An attribute is no XML: what the parser said.
    #[error(transparent)]
    Attribute(#[from] AttrError),
    /// It has no element `gpx`.
    #[error("no such element: it is no GPX file")]
    NoGpx,
    /// It ends within a point.
    #[error("the file ends within it")]
    Cut,
    /// A point lacks a coordinate.
    #[error("the point has none")]
    NoCoordinate,
    /// A coordinate is none.
    #[error("'{text}' is no angle up to {most} degrees")]
    Angle {
        /// What stands there.
        text: String,
        /// The largest angle.
        most: f64,
    },
    /// A time is none: what the parser said.
    #[error("'{text}': {source}")]
    Time {
        /// What stands there.
        text: String,
        /// Why it is none.
        source: jiff::Error,
    },
    /// A time has more nanoseconds since 1970 than can be counted.
    #[error("'{text}' is beyond 2262")]
    TooLate {
        /// The time as written.
        text: String,
    },
    /// A speed is none.
    #[error("'{text}' is no speed in m/s")]
    Speed {
        /// What stands there.
        text: String,
    },
}

/// Why a receiver's sentence cannot be read.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum NmeaProblem {
    /// The file has none.
    #[error("no sentence in it ($GPRMC,…)")]
    NoSentence,
    /// What the parser said, whose own error borrows the sentence.
    #[error("{0}")]
    Sentence(String),
    /// Its checksum differs.
    #[error("the checksum is {found:02X}, not {said:02X}")]
    Checksum {
        /// That of its letters.
        found: u8,
        /// The one it says.
        said: u8,
    },
    /// Its date has more nanoseconds since 1970 than can be counted.
    #[error("its date is beyond 2262")]
    TooLate,
}
