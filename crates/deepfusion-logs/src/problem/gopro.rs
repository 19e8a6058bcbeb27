//! What is wrong with a GoPro's video.

use deepfusion_hint::count_of;

/// How the boxes of an MP4 file contradict each other.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum Mp4Problem {
    /// The box that contains all others is missing.
    #[error("no such box: the recording was cut off, or this is not an MP4 file")]
    NoMovie,
    /// A box is missing.
    #[error("no such box")]
    NoBox,
    /// A box is shorter than its content.
    #[error("it ends early")]
    Cut,
    /// A box is longer than the one that contains it.
    #[error("{name}: size {}, but only {left} left", count_of(*size, "byte"))]
    Size {
        /// Name of the box.
        name: String,
        /// The size in its header, bytes.
        size: u64,
        /// Number of bytes left.
        left: usize,
    },
    /// The timescale of a track is 0.
    #[error("the timescale is 0")]
    Timescale,
    /// There are more samples than a file of its size can hold.
    #[error("more samples than the file has bytes")]
    Samples,
    /// A sample lies beyond the end of the file.
    #[error("a sample lies beyond the end of the file, which was cut off")]
    Beyond,
    /// Fewer samples have a time than a size.
    #[error("fewer samples than in stsz")]
    Times,
}

/// What is wrong with an entry of GoPro's metadata.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum GpmfProblem {
    /// An entry is longer than the data that contains it.
    #[error("{key}: length {}, but only {left} left", count_of(*length, "byte"))]
    Length {
        /// Key of the entry.
        key: String,
        /// The length in its header, bytes.
        length: usize,
        /// Number of bytes left.
        left: usize,
    },
    /// The values of an entry are not numbers.
    #[error("{key}: values of type '{kind}' are not numbers")]
    NoNumbers {
        /// Key of the entry.
        key: String,
        /// Letter of the values' type.
        kind: char,
    },
    /// The values of an entry have several types, and no entry before it lists them.
    #[error("{key}: no TYPE before it")]
    NoType {
        /// Key of the entry.
        key: String,
    },
    /// The readings of an entry have too few numbers.
    #[error("{key}: readings of {bytes} bytes, expected at least {least} numbers")]
    Readings {
        /// Key of the entry.
        key: String,
        /// Size of a reading, bytes.
        bytes: usize,
        /// Least number of numbers in a reading.
        least: usize,
    },
}
