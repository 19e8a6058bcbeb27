//! Why a file does not hold the arrays that it should.

use deepfusion_hint::count_of;
use ndarray_npy::ReadNpyError;
use zip::result::ZipError;

/// Why a file does not hold the arrays that it should.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum ArrayProblem {
    /// It is another kind of file.
    #[error("is neither an .npz nor an .npy file")]
    NotArrays,
    /// There is nothing in it.
    #[error("has no arrays")]
    Empty,
    /// It has fewer arrays than that.
    #[error("has {}, number {index} was asked for", count_of(*count, "array"))]
    NoSuchArray {
        /// How many it has.
        count: usize,
        /// The one asked for, from 0.
        index: usize,
    },
    /// An array of other dimensions.
    #[error("{array} has shape {found:?}, expected {expected}")]
    Shape {
        /// Which one.
        array: ArrayName,
        /// Its dimensions.
        found: Vec<usize>,
        /// What they should be.
        expected: ExpectedShape,
    },
    /// An array of other numbers, or of objects.
    #[error("{array} holds values of type {found}, expected float32 or float64")]
    Numbers {
        /// Which one.
        array: ArrayName,
        /// NumPy's name for what it holds.
        found: String,
    },
    /// An array of which something is missing.
    #[error("{array} has fewer numbers than its header says")]
    Cut {
        /// Which one.
        array: ArrayName,
    },
    /// An array that cannot be read.
    #[error("{array} cannot be read: {source}")]
    Unreadable {
        /// Which one.
        array: ArrayName,
        /// What the reader says.
        source: Box<ReadNpyError>,
    },
    /// An archive that cannot be read.
    #[error("cannot be read: {0}")]
    Archive(#[source] Box<ZipError>),
}

impl ArrayProblem {
    /// What to do about it, if there is something.
    pub(super) fn hint(&self) -> Option<&'static str> {
        match self {
            Self::NotArrays => Some(
                "write it with numpy.savez (arrays with names) or numpy.save (N×H×W in split order)",
            ),
            Self::Empty | Self::NoSuchArray { .. } => None,
            Self::Shape { .. } => Some("one H×W array an image; different sizes need an .npz"),
            Self::Numbers { .. } => Some(
                "convert with .astype(numpy.float32); pickled object arrays: numpy.savez(file, **{name: array, …})",
            ),
            Self::Cut { .. } | Self::Unreadable { .. } | Self::Archive(_) => {
                Some("the file may be cut off: write it again")
            }
        }
    }
}

/// Of what shape an array must be.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum ExpectedShape {
    /// That of a stack of images.
    #[error("N×H×W")]
    Stack,
    /// That of one image.
    #[error("H×W")]
    Image,
    /// That of one image with at least one pixel.
    #[error("H×W, not empty")]
    ImageWithPixels,
}

/// Which array of a file.
#[derive(Debug, Clone, PartialEq, Eq)]
#[non_exhaustive]
pub enum ArrayName {
    /// The only one, or all of them in one.
    Only,
    /// By its place, from 0.
    Number(usize),
    /// By its name.
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
