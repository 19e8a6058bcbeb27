//! What is wrong with a file of tracklets, and where.

use deepfusion_hint::count_of;
use std::fmt;

/// Where in a file of tracklets something is wrong; all but bytes are counted from 0.
#[derive(Debug, Clone, PartialEq, Eq)]
#[non_exhaustive]
pub enum TrackletPlace {
    /// Where the text stops being XML, or tracklets.
    Byte(u64),
    /// The list of them.
    List {
        /// An element of it.
        field: Option<String>,
    },
    /// A tracklet.
    Tracklet {
        /// Which.
        number: usize,
        /// One of its poses.
        pose: Option<usize>,
        /// An element of either.
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

/// What a file of tracklets has a count of.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[non_exhaustive]
pub enum TrackletPart {
    /// Labelled objects.
    Tracklets,
    /// Places of one.
    Poses,
}

impl fmt::Display for TrackletPart {
    /// One of them.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Tracklets => "tracklet",
            Self::Poses => "pose",
        })
    }
}

/// What is wrong with a file of tracklets.
#[derive(Debug, Clone, thiserror::Error)]
#[non_exhaustive]
pub enum TrackletsProblem {
    /// It is no XML.
    #[error("{0}")]
    Xml(#[source] Box<quick_xml::Error>),
    /// It is not whole.
    #[error("ends within <{}>", within.join("><"))]
    Ends {
        /// The elements that are open at its end, the outermost first.
        within: Vec<String>,
    },
    /// It is XML of something else.
    #[error("has no <boost_serialization><tracklets><count>: it holds no tracklets")]
    NoTracklets,
    /// An element is not there.
    #[error("has no <{element}>")]
    Lacks {
        /// Its name.
        element: &'static str,
    },
    /// A text is no whole number.
    #[error("'{text}' is not a whole number")]
    NotACount {
        /// The text, or its beginning.
        text: String,
    },
    /// A text is not a number, or it is NaN or infinite.
    #[error("'{text}' is not a finite number")]
    NotANumber {
        /// The text, or its beginning.
        text: String,
    },
    /// A side of a box that cannot be a length.
    #[error("{value} is not a length")]
    NotALength {
        /// What is said, in metres.
        value: f64,
    },
    /// There are more, or fewer, than is said.
    #[error("{}, its count says {announced}", count_of(*found, &of.to_string()))]
    Count {
        /// Of what.
        of: TrackletPart,
        /// How many there are.
        found: usize,
        /// How many there should be.
        announced: usize,
    },
}
