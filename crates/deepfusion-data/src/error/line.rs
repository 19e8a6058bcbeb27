//! Why a line of a list cannot be used: of times, or of the frames of a split.

use deepfusion_hint::count_of;

/// Why a line of a file of times cannot be used. Of a long line that is no time it holds the beginning alone.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum TimeStampProblem {
    /// It is no date and time of day.
    #[error("'{text}' is not a time stamp like 2011-09-26 13:04:32.345808896")]
    NotADate {
        /// The line.
        text: String,
    },
    /// It is not a number of seconds.
    #[error("'{text}' is not a time in seconds")]
    NotSeconds {
        /// The line.
        text: String,
    },
    /// It is neither.
    #[error("'{text}' is not a time")]
    NotATime {
        /// The line.
        text: String,
    },
    /// It does not come after the time above it.
    #[error("'{text}' is not after the line above")]
    NotAfter {
        /// The line, which may be cut where it is long.
        text: String,
    },
}

/// Why a line of a split file cannot be used.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum SplitProblem {
    /// It has more words than a frame's name, or one alone.
    #[error("{}, expected folder, index and side", count_of(*found, "word"))]
    Words {
        /// How many.
        found: usize,
    },
    /// Its second word is not a number.
    #[error("index '{text}' is not a frame number")]
    Index {
        /// The word.
        text: String,
    },
    /// Its third word is no side.
    #[error("side '{text}', expected l or r")]
    Side {
        /// The word.
        text: String,
    },
    /// No line of the file names a frame.
    #[error("the file names no frame")]
    NoFrame,
}
