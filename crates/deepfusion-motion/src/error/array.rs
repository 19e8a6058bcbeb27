//! Why an array file of a recording cannot be used.

use deepfusion_geometry::NpyHeaderProblem;
use deepfusion_hint::count_of;
use ndarray_npy::ReadNpyError;
use std::fmt;

/// Why an array file does not match a recording's layout.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum ArrayProblem {
    /// The file does not begin like an array file.
    #[error(transparent)]
    Header(#[from] NpyHeaderProblem),
    /// The file is shorter than its header says, or its items are not numbers.
    #[error("has fewer numbers than its header says, or no numbers")]
    Cut,
    /// The file does not contain floating-point numbers.
    #[error("not an array of float64 or float32: {0}")]
    NoFloats(#[source] ReadNpyError),
    /// The array has another shape.
    #[error("is {}, expected N×{columns}", by_times(shape))]
    Shape {
        /// Shape of the array.
        shape: Vec<usize>,
        /// Number of columns expected.
        columns: usize,
    },
    /// The numbers of rows and of times differ.
    #[error("{}, but {times} has {expected}", count_of(*rows, "row"))]
    Rows {
        /// Number of rows.
        rows: usize,
        /// The array with the times.
        times: TimesArray,
        /// Number of times.
        expected: usize,
    },
}

/// An array with the times for other arrays' rows.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[non_exhaustive]
pub enum TimesArray {
    /// `t` in the folder of a sensor's values.
    Beside,
    /// `frame_times` of the reference.
    Frames,
}

impl fmt::Display for TimesArray {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Beside => "`t` in the same folder",
            Self::Frames => "frame_times",
        })
    }
}

fn by_times(shape: &[usize]) -> String {
    let shape: Vec<String> = shape.iter().map(usize::to_string).collect();
    shape.join("×")
}
