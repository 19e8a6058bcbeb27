//! What is wrong with a track of fixes.

use quick_xml::events::attributes::AttrError;

/// Why a GPX file cannot be read.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum GpxProblem {
    /// The file is not valid XML; the parser's error.
    #[error(transparent)]
    Xml(#[from] quick_xml::Error),
    /// An attribute is not valid XML; the parser's error.
    #[error(transparent)]
    Attribute(#[from] AttrError),
    /// The file has no element `gpx`.
    #[error("no such element: not a GPX file")]
    NoGpx,
    /// The file ends inside a point.
    #[error("the file ends inside it")]
    Cut,
    /// A point lacks a coordinate.
    #[error("missing in this point")]
    NoCoordinate,
    /// A coordinate is invalid.
    #[error("'{text}' is not an angle of at most {most} degrees")]
    Angle {
        /// The text of the attribute.
        text: String,
        /// The largest valid angle, degrees.
        most: f64,
    },
    /// A time is invalid.
    #[error("'{text}': {source}")]
    Time {
        /// The text of the element.
        text: String,
        /// The parser's error.
        source: jiff::Error,
    },
    /// A time has more nanoseconds since 1970 than an `i64` holds.
    #[error("'{text}' is after the year 2262")]
    TooLate {
        /// The time as written.
        text: String,
    },
    /// A speed is invalid.
    #[error("'{text}' is not a speed in m/s")]
    Speed {
        /// The text of the element.
        text: String,
    },
}

/// Why a receiver's sentence cannot be read.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum NmeaProblem {
    /// The file has no sentence.
    #[error("the file has no NMEA sentence ($GPRMC,…)")]
    NoSentence,
    /// The parser's message; its error itself borrows the sentence.
    #[error("{0}")]
    Sentence(String),
    /// The checksum of a sentence is wrong.
    #[error("the checksum is {found:02X}, the sentence says {stated:02X}")]
    Checksum {
        /// The checksum of its characters.
        found: u8,
        /// The checksum written in it.
        stated: u8,
    },
    /// The date has more nanoseconds since 1970 than an `i64` holds.
    #[error("its date is after the year 2262")]
    TooLate,
}
