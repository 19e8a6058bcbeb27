//! Why a file does not contain the expected arrays.

use deepfusion_hint::count_of;
use ndarray_npy::ReadNpyError;
use zip::result::ZipError;

/// Why a file does not contain the expected arrays.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum ArrayProblem {
    /// The file is of another kind.
    #[error("neither an .npz nor an .npy file")]
    NotArrays,
    /// The file is empty.
    #[error("has no arrays")]
    Empty,
    /// The file has fewer arrays than the index asked for.
    #[error("has {}, but index {index} was asked for", count_of(*count, "array"))]
    NoSuchArray {
        /// Number of arrays in the file.
        count: usize,
        /// The index asked for, from 0.
        index: usize,
    },
    /// An array has the wrong number of dimensions.
    #[error("{array} has shape {found:?}, expected {expected}")]
    Shape {
        /// The array.
        array: ArrayName,
        /// Its dimensions.
        found: Vec<usize>,
        /// The expected dimensions.
        expected: ExpectedShape,
    },
    /// An array contains numbers of another type, or objects.
    #[error("{array} has values of type {found}, expected float32 or float64")]
    Numbers {
        /// The array.
        array: ArrayName,
        /// NumPy's name for the type.
        found: String,
    },
    /// An array is incomplete.
    #[error("{array} has fewer numbers than its header says")]
    Cut {
        /// The array.
        array: ArrayName,
    },
    /// An array cannot be read.
    #[error("{array} cannot be read: {source}")]
    Unreadable {
        /// The array.
        array: ArrayName,
        /// The reader's error.
        source: Box<ReadNpyError>,
    },
    /// The archive cannot be read.
    #[error("cannot be read: {0}")]
    Archive(#[source] Box<ZipError>),
}

impl ArrayProblem {
    /// What to do about it, if known.
    pub(super) fn hint(&self) -> Option<&'static str> {
        match self {
            Self::NotArrays => Some(
                "write it with numpy.savez (arrays with names) or numpy.save (N×H×W in split order)",
            ),
            Self::Empty => Some("write one array per image, with numpy.savez"),
            Self::NoSuchArray { .. } => None,
            Self::Shape { .. } => {
                Some("write one H×W array per image; for images of different sizes, use an .npz")
            }
            Self::Numbers { .. } => Some(
                "convert with .astype(numpy.float32); replace a pickled object array by numpy.savez(file, **{name: array, …})",
            ),
            Self::Cut { .. } | Self::Unreadable { .. } | Self::Archive(_) => {
                Some("write the file again: it may be cut off")
            }
        }
    }
}

/// The expected shape of an array.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum ExpectedShape {
    /// A stack of images.
    #[error("N×H×W")]
    Stack,
    /// One image.
    #[error("H×W")]
    Image,
    /// One image with at least one pixel.
    #[error("H×W, not empty")]
    ImageWithPixels,
}

/// An array in a file.
#[derive(Debug, Clone, PartialEq, Eq)]
#[non_exhaustive]
pub enum ArrayName {
    /// The only array, or the whole stack.
    Only,
    /// By index, from 0.
    Number(usize),
    /// By name.
    Named(String),
}

impl std::fmt::Display for ArrayName {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            Self::Only => f.write_str("the array"),
            Self::Number(index) => write!(f, "array {index}"),
            Self::Named(name) => write!(f, "array `{name}`"),
        }
    }
}
