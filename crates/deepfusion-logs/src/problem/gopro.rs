//! What is wrong with a GoPro's video.

use deepfusion_hint::count_of;

/// How an MP4 file's boxes contradict each other.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum Mp4Problem {
    /// The box that holds all others is missing.
    #[error("no such box: the recording was cut off, or this is no MP4 file")]
    NoMovie,
    /// A box is missing.
    #[error("no such box")]
    NoBox,
    /// A box is shorter than what it holds.
    #[error("it ends early")]
    Cut,
    /// A box is longer than the one it lies in.
    #[error("{name}: {}, where {left} are left", count_of(*size, "byte"))]
    Size {
        /// The box's name.
        name: String,
        /// The size it says.
        size: u64,
        /// How many bytes there are.
        left: usize,
    },
    /// A track's clock stands still.
    #[error("a timescale of 0")]
    Timescale,
    /// There are more samples than a file of its size can hold.
    #[error("more samples than bytes")]
    Samples,
    /// A sample lies where the file has no bytes.
    #[error("a sample lies beyond the file's end: it was cut off")]
    Beyond,
    /// Fewer samples have a time than have a size.
    #[error("fewer samples than stsz")]
    Times,
}

/// What is wrong with an entry of GoPro's metadata.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum GpmfProblem {
    /// It is longer than what it lies in.
    #[error("{key}: {}, where {left} are left", count_of(*length, "byte"))]
    Length {
        /// Its key.
        key: String,
        /// The length it says.
        length: usize,
        /// How many bytes there are.
        left: usize,
    },
    /// Its values are of a kind that is not a number.
    #[error("{key}: values of kind '{kind}' are not numbers")]
    NoNumbers {
        /// Its key.
        key: String,
        /// The kind's letter.
        kind: char,
    },
    /// Its values are of several kinds, and no entry before it says which.
    #[error("{key}: no TYPE before it")]
    NoType {
        /// Its key.
        key: String,
    },
    /// Its readings are not of the numbers they should be.
    #[error("{key}: readings of {bytes} bytes, expected {least} numbers")]
    Readings {
        /// Its key.
        key: String,
        /// Bytes of a reading.
        bytes: usize,
        /// The fewest numbers that a reading has.
        least: usize,
    },
}
