use deepfusion_hint::{Hint, count_of, system_hint};
use std::path::PathBuf;

mod arrays;

pub use self::arrays::{ArrayName, ArrayProblem, ExpectedShape};

/// Shares of the pixels that intervals are to hold.
pub const LEVELS: [f64; 3] = [0.5, 0.8, 0.95];

/// Where the ranges of predicted depth end, metres; the last goes on.
pub(crate) const ENDS_M: [f64; 3] = [10.0, 20.0, 40.0];

/// What can go wrong while arrays are read and compared.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum Error {
    /// A prediction holds values that cannot be a depth or disparity.
    #[error(
        "prediction `{name}` has {count} of {} that {} no {kind}: {} {value} at column {x}, row {y} \
         (expected finite and above 0)",
        count_of(*total, "value"),
        if *count == 1 { "is" } else { "are" },
        if *count == 1 { "it is" } else { "the first is" }
    )]
    InvalidPrediction {
        /// Name of the array.
        name: String,
        /// "depth" or "disparity".
        kind: &'static str,
        /// The first such value.
        value: f64,
        /// Its column.
        x: usize,
        /// Its row.
        y: usize,
        /// How many there are.
        count: usize,
        /// How many values the array has.
        total: usize,
    },
    /// Width × height and the number of values differ, or one of them is zero.
    #[error("`{name}` is {width}×{height} but has {}", count_of(*len, "value"))]
    Shape {
        /// What the array is.
        name: String,
        /// Its width, in pixels.
        width: usize,
        /// Its height, in pixels.
        height: usize,
        /// How many values were given.
        len: usize,
    },
    /// A protocol that nothing can be measured with.
    #[error("{field} is {value}: expected {expected}")]
    Protocol {
        /// The field of [`crate::Protocol`].
        field: &'static str,
        /// Its value.
        value: String,
        /// What it must be.
        expected: ExpectedProtocolSetting,
    },
    /// No image had a single pixel to compare.
    #[error("{}", nothing_compared(*skipped, names))]
    NothingToEvaluate {
        /// How many images were skipped.
        skipped: usize,
        /// The first few names.
        names: String,
    },
    /// Factors of intervals that are none of this program's.
    #[error("factors of intervals: {reason}")]
    Intervals {
        /// What is wrong.
        reason: IntervalsProblem,
    },
    /// A file that cannot be opened or read.
    #[error("cannot read {path}")]
    Io {
        /// The file.
        path: PathBuf,
        /// Why.
        source: std::io::Error,
    },
    /// An array file whose content is not what was expected.
    #[error("{path}: {reason}")]
    ArrayFile {
        /// The file.
        path: PathBuf,
        /// What is wrong, and with which array.
        #[source]
        reason: ArrayProblem,
    },
    /// Ground truth without prediction, or the other way round.
    #[error("{path} has no array for {count} of {of}: {names}")]
    UnmatchedNames {
        /// The file in which arrays are missing.
        path: PathBuf,
        /// How many are missing.
        count: usize,
        /// Where the names come from ("the 25 in gt.npz").
        of: String,
        /// The first few missing names.
        names: String,
        /// A name that the file has instead.
        instead: Option<String>,
    },
    /// A stack of arrays in split order that is longer or shorter than its counterpart.
    #[error(
        "{path} has {}, {other} has {expected}: arrays in split order need the same number",
        count_of(*count, "array")
    )]
    Count {
        /// The prediction file.
        path: PathBuf,
        /// How many arrays it has.
        count: usize,
        /// The ground-truth file.
        other: PathBuf,
        /// How many that has.
        expected: usize,
    },
}

/// A result of this crate.
pub type Result<T> = std::result::Result<T, Error>;

/// What a field of a protocol must be.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum ExpectedProtocolSetting {
    /// A depth, in metres.
    #[error("metres above 0")]
    Metres,
    /// A depth beyond the smallest that is compared, in metres.
    #[error("metres above the minimum depth")]
    MetresAboveMinimum,
    /// A factor of all depths.
    #[error("a factor above 0")]
    Factor,
}

/// Whether there is no ground truth at all, or none that counts.
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
                "a network's {kind} is positive everywhere; where these values mean \"no prediction\", allow holes: \
                 they are left out and counted as missing_rate"
            )),
            Self::Shape { .. } => Some("arrays are H×W, row by row".into()),
            Self::Protocol { field, expected, .. } => Some(format!("set {field} to {expected}")),
            Self::NothingToEvaluate { skipped: 0, .. } => Some("no frame has ground truth of the kind asked for".into()),
            Self::NothingToEvaluate { .. } => Some(
                "check that the ground truth is in metres and 0 where there is none, and that crop and cap leave pixels"
                    .into(),
            ),
            Self::Intervals { .. } => {
                Some("calibrate the network's uncertainty anew".into())
            }
            Self::Io { source, .. } => Some(system_hint(source.kind()).into()),
            Self::ArrayFile { reason, .. } => reason.hint().map(str::to_owned),
            Self::UnmatchedNames { instead, .. } => Some(match instead {
                Some(name) => format!(
                    "arrays are matched by name, and this file names its arrays like `{name}`; the same names are needed in both"
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

/// Why factors are none of this program's.
#[derive(Debug, Clone, Copy, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum IntervalsProblem {
    /// They are for other shares of the pixels than [`LEVELS`].
    #[error("levels {found:?}, expected {:?}", LEVELS)]
    Levels {
        /// The shares.
        found: [f64; 3],
    },
    /// They are for other ranges of depths.
    #[error("ranges other than those ending at {:?} m", ENDS_M)]
    Ranges,
    /// One that is negative or NaN.
    #[error("a factor of {factor}")]
    Factor {
        /// The factor.
        factor: f64,
    },
}
