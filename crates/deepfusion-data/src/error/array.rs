//! Why an array file cannot be read or written.

use deepfusion_hint::count_of;
use deepfusion_motion::comma;
use ndarray::ShapeError;
use ndarray_npy::WriteNpzError;

/// Why an array file cannot be written.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum ArrayProblem {
    /// The number of values differs from the number of pixels.
    #[error("{0}")]
    Shape(#[source] ShapeError),
    /// The array writer's error.
    #[error("{0}")]
    Write(#[source] Box<WriteNpzError>),
}

/// Why an array of a comma2k19 segment cannot be used.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum SegmentProblem {
    /// The file is not an array of numbers.
    #[error("{0}")]
    Array(#[source] comma::ArrayProblem),
    /// The array has more or fewer values than there are times.
    #[error("{}, but t has {times}", count_of(*values, "value"))]
    Length {
        /// Number of values in the array.
        values: usize,
        /// Number of times.
        times: usize,
    },
    /// A number is not a possible speed.
    #[error("row {row}: {value} is not a speed")]
    NotASpeed {
        /// The row, counted from 0.
        row: usize,
        /// The row's number.
        value: f64,
    },
    /// A number is not a possible time, or is before the time of the previous row.
    #[error("row {row}: {time_s} s after {last_s} s is not a valid time")]
    NotATime {
        /// The row, counted from 0.
        row: usize,
        /// The row's number, in seconds.
        time_s: f64,
        /// The time in the previous row, in seconds.
        last_s: f64,
    },
}
