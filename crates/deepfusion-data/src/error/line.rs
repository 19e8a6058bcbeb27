//! Why a line of a time stamp file or of a split file cannot be used.

use deepfusion_hint::count_of;

/// Why a line of a time stamp file cannot be used. A long line is cut.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum TimeStampProblem {
    /// The line is not a date with a time of day.
    #[error("'{text}' is not a time stamp like 2011-09-26 13:04:32.345808896")]
    NotADate {
        /// The line.
        text: String,
    },
    /// The line is not a number of seconds.
    #[error("'{text}' is not a time in seconds")]
    NotSeconds {
        /// The line.
        text: String,
    },
    /// The line is neither of these.
    #[error("'{text}' is not a time")]
    NotATime {
        /// The line.
        text: String,
    },
    /// The time is not after that of the previous line.
    #[error("'{text}' is not after the line above")]
    NotAfter {
        /// The line.
        text: String,
    },
}

/// Why a line of a split file cannot be used.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum SplitProblem {
    /// The line has too many words, or only one.
    #[error("{}, expected folder, index and side", count_of(*found, "word"))]
    Words {
        /// Number of words.
        found: usize,
    },
    /// The second word is not a number.
    #[error("index '{text}' is not a frame number")]
    Index {
        /// The word.
        text: String,
    },
    /// The third word is not a side.
    #[error("side '{text}', expected l or r")]
    Side {
        /// The word.
        text: String,
    },
    /// No line of the file names a frame.
    #[error("the file names no frame")]
    NoFrame,
}
