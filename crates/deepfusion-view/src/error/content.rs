//! What folders of results hold, and why a file is not what its name says.

use deepfusion_geometry::NpyHeaderProblem;

/// What a folder of results holds.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum FolderKind {
    /// The output of `predict` or `perceive`.
    #[error("predictions")]
    Predictions,
    /// A training run without predictions: its learning curve and panels.
    #[error("a training run")]
    Training,
}

/// Why a file is not what its name says.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum ContentProblem {
    /// A training log is no table: what the parser said.
    #[error(transparent)]
    Csv(#[from] csv::Error),
    /// A table is not a training log.
    #[error("no columns `step` and `split`: not a training log")]
    NoLog,
    /// A description is too long to be a frame's.
    #[error("{bytes} bytes are too many for a frame's description")]
    TooLong {
        /// Its length.
        bytes: u64,
    },
    /// A description is no JSON, or not all of it is there yet.
    #[error("{}: {}", no_json(.0), .0)]
    Json(#[from] serde_json::Error),
    /// A depth image is larger than any camera's.
    #[error("{width}x{height} pixels are more than any camera's image has")]
    TooLarge {
        /// Its width.
        width: u64,
        /// Its height.
        height: u64,
    },
    /// A depth array cannot be read.
    #[error(transparent)]
    Array(#[from] ArrayProblem),
}

fn no_json(error: &serde_json::Error) -> &'static str {
    if error.is_eof() {
        "half-written, or cut off"
    } else {
        "no JSON"
    }
}

/// Why an NPY array is no depth image.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum ArrayProblem {
    /// It does not begin as one.
    #[error(transparent)]
    Header(#[from] NpyHeaderProblem),
    /// It is cut off within its numbers.
    #[error("ends early: {bytes} bytes of {expected} (a {}x{} array)", size.0, size.1)]
    Cut {
        /// The file's length.
        bytes: u64,
        /// The length it should have.
        expected: u64,
        /// Its width and height.
        size: (u64, u64),
    },
    /// Its numbers are of another type; `None` where it does not say which.
    #[error("depth is `<f4` or `<f8`, not {}", .0.as_deref().unwrap_or("without a type"))]
    Type(Option<String>),
    /// It is stored column by column.
    #[error("depth is stored row by row (fortran_order False)")]
    ColumnByColumn,
    /// It has so many dimensions.
    #[error("depth has two dimensions, this array {0}")]
    Dimensions(usize),
}
