//! Why an array file cannot be used, or not be written.

use deepfusion_hint::count_of;
use deepfusion_motion::comma;
use ndarray::ShapeError;
use ndarray_npy::WriteNpzError;

/// Why an array file cannot be written.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum ArrayProblem {
    /// There are not as many values as pixels.
    #[error("{0}")]
    Shape(#[source] ShapeError),
    /// What the writer of array files says.
    #[error("{0}")]
    Write(#[source] Box<WriteNpzError>),
}

/// Why an array of a comma2k19 segment cannot be used.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum SegmentProblem {
    /// It is no array of numbers.
    #[error("{0}")]
    Array(#[source] comma::ArrayProblem),
    /// It has not as many values as times.
    #[error("{}, but t has {times}", count_of(*values, "value"))]
    Length {
        /// How many values it has.
        values: usize,
        /// How many times there are.
        times: usize,
    },
    /// A number that cannot be a speed.
    #[error("row {row}: {value} is no speed")]
    NotASpeed {
        /// The row, counted from 0.
        row: usize,
        /// What it holds.
        value: f64,
    },
    /// A number that cannot be a time, or a time that goes back.
    #[error("row {row}: {time_s} s after {last_s} s is no time")]
    NotATime {
        /// The row, counted from 0.
        row: usize,
        /// What it holds, in seconds.
        time_s: f64,
        /// The time before it, in seconds.
        last_s: f64,
    },
}
