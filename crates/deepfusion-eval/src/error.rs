use deepfusion_fs::FileError;
use deepfusion_hint::{Hint, count_of};
use std::path::PathBuf;

mod arrays;

pub use self::arrays::{ArrayName, ArrayProblem, ExpectedShape};

/// Shares of the pixels that the intervals should contain.
pub const LEVELS: [f64; 3] = [0.5, 0.8, 0.95];

/// Upper ends of the ranges of predicted depth, in metres; the last range is open.
pub(crate) const ENDS_M: [f64; 3] = [10.0, 20.0, 40.0];

/// What can go wrong when arrays are read and compared.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum Error {
    /// A prediction contains values that are not a valid depth or disparity.
    #[error(
        "prediction `{name}` has {count} of {} that {} not a valid {kind}: {} {value} at column {x}, row {y} \
         (expected finite and above 0)",
        count_of(*total, "value"),
        if *count == 1 { "is" } else { "are" },
        if *count == 1 { "it is" } else { "the first is" }
    )]
    InvalidPrediction {
        /// Name of the prediction's array.
        name: String,
        /// "depth" or "disparity".
        kind: &'static str,
        /// The first such value.
        value: f64,
        /// The value's column.
        x: usize,
        /// The value's row.
        y: usize,
        /// Number of such values.
        count: usize,
        /// Number of values in the array.
        total: usize,
    },
    /// The number of values is not width × height, or is zero.
    #[error("`{name}` is {width}x{height} but has {}", count_of(*len, "value"))]
    Shape {
        /// Name of the array.
        name: String,
        /// Width given, in pixels.
        width: usize,
        /// Height given, in pixels.
        height: usize,
        /// Number of values given.
        len: usize,
    },
    /// A protocol that cannot measure anything.
    #[error("{field} is {value}, expected {expected}")]
    Protocol {
        /// The field of [`crate::Protocol`].
        field: &'static str,
        /// The field's value.
        value: String,
        /// What the value must be.
        expected: ExpectedProtocolSetting,
    },
    /// No image had a single pixel to compare.
    #[error("{}", nothing_compared(*skipped, names))]
    NothingToEvaluate {
        /// Number of skipped images.
        skipped: usize,
        /// The names of the first few skipped images.
        names: String,
    },
    /// Interval factors that this version cannot use.
    #[error("interval factors: {reason}")]
    Intervals {
        /// What is wrong with them.
        reason: IntervalsProblem,
    },
    /// A file that cannot be opened or read.
    #[error(transparent)]
    File(#[from] FileError),
    /// An array file with unexpected content.
    #[error("{path}: {reason}")]
    ArrayFile {
        /// Path of the file.
        path: PathBuf,
        /// What is wrong, and with which array.
        #[source]
        reason: ArrayProblem,
    },
    /// Ground truth without a prediction, or the other way round.
    #[error("{path}: no array for {count} of {of}: {names}")]
    UnmatchedNames {
        /// The file that lacks arrays.
        path: PathBuf,
        /// Number of missing arrays.
        count: usize,
        /// Where the names come from ("the 25 in gt.npz").
        of: String,
        /// The first few missing names.
        names: String,
        /// A name that the file contains instead.
        instead: Option<String>,
    },
    /// Two files in split order have different numbers of arrays.
    #[error(
        "{path} has {}, {other} has {expected}: arrays in split order need the same number",
        count_of(*count, "array")
    )]
    Count {
        /// Path of the prediction file.
        path: PathBuf,
        /// Number of arrays in it.
        count: usize,
        /// Path of the ground-truth file.
        other: PathBuf,
        /// Number of arrays in that file.
        expected: usize,
    },
}

/// A result with this crate's [`Error`].
pub type Result<T> = std::result::Result<T, Error>;

/// What a field of a protocol must be.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum ExpectedProtocolSetting {
    /// A depth, in metres.
    #[error("metres above 0")]
    Metres,
    /// A depth above the minimum depth, in metres.
    #[error("metres above the minimum depth")]
    MetresAboveMinimum,
    /// A factor by which all depths are multiplied.
    #[error("a factor above 0")]
    Factor,
}

/// States whether there is no ground truth at all, or none inside the mask.
fn nothing_compared(skipped: usize, names: &str) -> String {
    if names.is_empty() {
        "nothing to compare with: no image has ground truth".into()
    } else {
        format!("no image has a ground-truth depth inside the mask ({skipped} skipped: {names})")
    }
}

impl Hint for Error {
    fn hint(&self) -> Option<String> {
        match self {
            Self::InvalidPrediction { kind, .. } => Some(format!(
                "a network's {kind} is positive everywhere; if these values mean \"no prediction\", allow holes: \
                 they are left out and counted as missing_rate"
            )),
            Self::Shape { .. } => Some("give height × width values, row by row".into()),
            Self::Protocol { field, expected, .. } => Some(format!("set {field} to {expected}")),
            Self::NothingToEvaluate { skipped: 0, .. } => Some("use frames that have ground truth of the kind asked for".into()),
            Self::NothingToEvaluate { .. } => Some(
                "check that the ground truth is in metres and 0 where there is none, and that crop and cap leave pixels"
                    .into(),
            ),
            Self::Intervals { .. } => {
                Some("calibrate the network's uncertainty again".into())
            }
            Self::File(error) => error.hint(),
            Self::ArrayFile { reason, .. } => reason.hint().map(str::to_owned),
            Self::UnmatchedNames { instead, .. } => Some(match instead {
                Some(name) => format!(
                    "arrays are matched by name: use the same names in both files (this one has names like `{name}`)"
                ),
                None => "arrays are matched by name; write both files from the same list of frames".into(),
            }),
            Self::Count { .. } => Some(
                "write the predictions from the same split file as the ground truth, or use .npz files with names".into(),
            ),
        }
    }
}

/// The first few of `names`, for a message.
pub(crate) fn first_names<'a>(names: impl IntoIterator<Item = &'a String>) -> String {
    let names: Vec<_> = names.into_iter().collect();
    let shown: Vec<_> = names.iter().take(5).map(|n| n.as_str()).collect();
    let more = if names.len() > shown.len() {
        ", …"
    } else {
        ""
    };
    format!("{}{more}", shown.join(", "))
}

/// Why interval factors cannot be used.
#[derive(Debug, Clone, Copy, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum IntervalsProblem {
    /// They are for shares of pixels other than [`LEVELS`].
    #[error("levels {found:?}, expected {:?}", LEVELS)]
    Levels {
        /// The shares found.
        found: [f64; 3],
    },
    /// They are for other ranges of depth.
    #[error("the ranges do not end at {:?} m", ENDS_M)]
    Ranges,
    /// A factor is negative or NaN.
    #[error("a factor is {factor}, expected 0 or more")]
    Factor {
        /// The factor found.
        factor: f64,
    },
}
