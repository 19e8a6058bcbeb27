//! What is wrong with a tracklet file, and where.

use deepfusion_hint::count_of;
use std::fmt;

/// The place in a tracklet file where something is wrong. Tracklets and poses are counted from 0.
#[derive(Debug, Clone, PartialEq, Eq)]
#[non_exhaustive]
pub enum TrackletPlace {
    /// The offset in bytes at which the text is not XML, or not tracklets.
    Byte(u64),
    /// The list of tracklets.
    List {
        /// The element of the list, if known.
        field: Option<String>,
    },
    /// A tracklet.
    Tracklet {
        /// The tracklet's number.
        number: usize,
        /// The number of its pose, if a pose is wrong.
        pose: Option<usize>,
        /// The element of the tracklet or pose, if known.
        field: Option<String>,
    },
}

impl fmt::Display for TrackletPlace {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let field = match self {
            Self::Byte(byte) => return write!(f, "byte {byte}"),
            Self::List { field } => {
                f.write_str("the list of tracklets")?;
                field
            }
            Self::Tracklet {
                number,
                pose,
                field,
            } => {
                write!(f, "tracklet {number}")?;
                if let Some(pose) = pose {
                    write!(f, ", pose {pose}")?;
                }
                field
            }
        };
        match field {
            Some(field) => write!(f, ", {field}"),
            None => Ok(()),
        }
    }
}

/// What a tracklet file counts.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[non_exhaustive]
pub enum TrackletPart {
    /// Labelled objects.
    Tracklets,
    /// Poses of an object.
    Poses,
}

impl fmt::Display for TrackletPart {
    /// The singular.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Tracklets => "tracklet",
            Self::Poses => "pose",
        })
    }
}

/// What is wrong with a tracklet file.
#[derive(Debug, Clone, thiserror::Error)]
#[non_exhaustive]
pub enum TrackletsProblem {
    /// The file is not XML.
    #[error("{0}")]
    Xml(#[source] Box<quick_xml::Error>),
    /// The file is truncated.
    #[error("ends within <{}>", within.join("><"))]
    Ends {
        /// The elements still open at its end, from the outermost to the innermost.
        within: Vec<String>,
    },
    /// The file is XML, but not tracklets.
    #[error("not a tracklet file: no <boost_serialization><tracklets><count>")]
    NoTracklets,
    /// An element is missing.
    #[error("no <{element}>")]
    Lacks {
        /// Its name.
        element: &'static str,
    },
    /// A text is not a whole number.
    #[error("'{text}' is not a whole number")]
    NotACount {
        /// The text, or its beginning.
        text: String,
    },
    /// A text is not a number, or is NaN or infinite.
    #[error("'{text}' is not a finite number")]
    NotANumber {
        /// The text, or its beginning.
        text: String,
    },
    /// A side of a box is not a possible length.
    #[error("{value} is not a length")]
    NotALength {
        /// The value, in metres.
        value: f64,
    },
    /// The number of elements differs from the stated count.
    #[error("{}, but <count> is {announced}", count_of(*found, &of.to_string()))]
    Count {
        /// What is counted.
        of: TrackletPart,
        /// How many elements the file has.
        found: usize,
        /// The stated count.
        announced: usize,
    },
}
