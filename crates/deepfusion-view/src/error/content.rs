//! What folders of results contain, and why a file's content does not match its name.

use deepfusion_geometry::NpyHeaderProblem;

/// What a folder of results contains.
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

/// Why a file's content does not match its name.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum ContentProblem {
    /// A training log is not a table: the parser's error.
    #[error(transparent)]
    Csv(#[from] csv::Error),
    /// A table is not a training log.
    #[error("no columns `step` and `split`: not a training log")]
    NoLog,
    /// A JSON file is too long to be a frame's.
    #[error("too large for a frame's JSON file: {bytes} bytes")]
    TooLong {
        /// The file's length.
        bytes: u64,
    },
    /// A frame's JSON file is not JSON, or incomplete.
    #[error("{}: {}", no_json(.0), .0)]
    Json(#[from] serde_json::Error),
    /// A depth image is larger than any camera's.
    #[error("too large for a camera's image: {width}x{height} pixels")]
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
        "incomplete or truncated"
    } else {
        "not JSON"
    }
}

/// Why an NPY array is not a depth image.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum ArrayProblem {
    /// The header is not that of an array.
    #[error(transparent)]
    Header(#[from] NpyHeaderProblem),
    /// The file ends within its numbers.
    #[error("ends early: {bytes} bytes of {expected} (a {}x{} array)", size.0, size.1)]
    Cut {
        /// The file's length.
        bytes: u64,
        /// The length it should have.
        expected: u64,
        /// Width and height of the array.
        size: (u64, u64),
    },
    /// The numbers have another type; `None` if the header has none.
    #[error("expected the type `<f4` or `<f8`, found {}", .0.as_deref().unwrap_or("none"))]
    Type(Option<String>),
    /// The array is stored column by column.
    #[error("stored column by column, expected row by row (fortran_order False)")]
    ColumnByColumn,
    /// The array does not have two dimensions, but this number.
    #[error("expected two dimensions, found {0}")]
    Dimensions(usize),
}
