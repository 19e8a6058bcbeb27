//! Why a file of poses cannot be used, and where in it.

use deepfusion_hint::count_of;
use std::fmt;

/// Where in a line of a file of poses something is wrong.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[non_exhaustive]
pub enum PoseField {
    /// The frame's number, which comes first.
    Frame,
    /// One of its numbers, counted from 1.
    Value {
        /// Which.
        number: usize,
        /// Of how many.
        of: usize,
    },
    /// All of them.
    Pose,
}

impl fmt::Display for PoseField {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Frame => f.write_str("value 1"),
            Self::Value { number, of } => write!(f, "value {number} of {of}"),
            Self::Pose => f.write_str("pose"),
        }
    }
}

/// Why a line of a file of poses cannot be used.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum PoseProblem {
    /// A word is not a number, or it is NaN or infinite.
    #[error("'{text}' is not a finite number")]
    NotANumber {
        /// The word, or its beginning.
        text: String,
    },
    /// It has too many numbers, or too few.
    #[error("{}, expected {expected}", count_of(*found, "number"))]
    Length {
        /// How many it has.
        found: usize,
        /// How many it should have.
        expected: usize,
    },
    /// It does not begin with a frame's number.
    #[error("{value} is not a frame's number")]
    NotAFrame {
        /// With what it begins.
        value: f64,
    },
    /// Its matrix turns nothing, or mirrors it.
    #[error("its matrix is not a rotation")]
    NoRotation,
    /// There is no line.
    #[error("the file is empty")]
    NoPose,
}

/// Why the file of an RGB-D frame's pose cannot be used.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum PoseFileProblem {
    /// A word is not a number.
    #[error("a word is not a number")]
    NotANumber,
    /// Its matrix is not whole.
    #[error("{}, expected 16", count_of(*found, "number"))]
    Length {
        /// How many numbers it has.
        found: usize,
    },
    /// Its matrix turns nothing, or mirrors it.
    #[error("its matrix is not a rotation")]
    NoRotation,
}
