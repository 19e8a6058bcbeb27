//! Why an array file of a recording is of no use.

use deepfusion_geometry::NpyHeaderProblem;
use deepfusion_hint::count_of;
use ndarray_npy::ReadNpyError;
use std::fmt;

/// Why an array file is not what a recording's layout says.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum ArrayProblem {
    /// It does not begin as an array file.
    #[error(transparent)]
    Header(#[from] NpyHeaderProblem),
    /// It is shorter than its header says, or its items are no numbers.
    #[error("has fewer numbers than its header says, or no numbers")]
    Cut,
    /// It cannot be read as an array of numbers with a fraction.
    #[error("no array of float64 or float32: {0}")]
    NoFloats(#[source] ReadNpyError),
    /// It has another shape.
    #[error("is {}, expected N×{columns}", by_times(shape))]
    Shape {
        /// Its shape.
        shape: Vec<usize>,
        /// How many columns it should have.
        columns: usize,
    },
    /// It has another number of rows than its times.
    #[error("{}, but {times} has {expected}", count_of(*rows, "row"))]
    Rows {
        /// How many it has.
        rows: usize,
        /// The array of times.
        times: TimesArray,
        /// How many times there are.
        expected: usize,
    },
}

/// An array with the times of others' rows.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[non_exhaustive]
pub enum TimesArray {
    /// `t` beside the values of a sensor.
    Beside,
    /// `frame_times` of the reference.
    Frames,
}

impl fmt::Display for TimesArray {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Beside => "`t` beside it",
            Self::Frames => "frame_times",
        })
    }
}

fn by_times(shape: &[usize]) -> String {
    let shape: Vec<String> = shape.iter().map(usize::to_string).collect();
    shape.join("×")
}
