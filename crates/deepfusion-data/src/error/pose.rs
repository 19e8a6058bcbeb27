//! Why a pose file cannot be used, and where in it.

use deepfusion_hint::count_of;
use std::fmt;

/// The part of a pose file's line that is wrong.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[non_exhaustive]
pub enum PoseField {
    /// The frame's number, which comes first.
    Frame,
    /// One of its numbers.
    Value {
        /// Which one, counted from 1.
        number: usize,
        /// How many numbers there are.
        of: usize,
    },
    /// The whole pose.
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

/// Why a line of a pose file cannot be used.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum PoseProblem {
    /// A word is not a number, or is NaN or infinite.
    #[error("'{text}' is not a finite number")]
    NotANumber {
        /// The word, or its beginning.
        text: String,
    },
    /// The line has too many numbers, or too few.
    #[error("{}, expected {expected}", count_of(*found, "number"))]
    Length {
        /// How many it has.
        found: usize,
        /// How many it should have.
        expected: usize,
    },
    /// The line does not begin with a frame number.
    #[error("{value} is not a frame number")]
    NotAFrame {
        /// Its first number.
        value: f64,
    },
    /// The pose's matrix is not a rotation.
    #[error("its matrix is not a rotation")]
    NoRotation,
    /// The file has no lines.
    #[error("the file is empty")]
    NoPose,
}

/// Why the pose file of an RGB-D frame cannot be used.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum PoseFileProblem {
    /// A word is not a number.
    #[error("a value is not a number")]
    NotANumber,
    /// The file has too many numbers, or too few.
    #[error("{}, expected 16", count_of(*found, "number"))]
    Length {
        /// How many numbers it has.
        found: usize,
    },
    /// The pose's matrix is not a rotation.
    #[error("its matrix is not a rotation")]
    NoRotation,
}
