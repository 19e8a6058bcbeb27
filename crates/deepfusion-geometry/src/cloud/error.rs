//! What can go wrong with a point cloud or its file.

mod size;

pub use self::size::SizeProblem;

use deepfusion_fs::FileError;
use deepfusion_hint::{Hint, system_hint};
use std::path::PathBuf;

/// What can go wrong with a point cloud or its file.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum Error {
    /// A file could not be opened, read or written.
    #[error(transparent)]
    File(#[from] FileError),
    /// Reading or writing a stream failed.
    #[error("point cloud: {0}")]
    Stream(#[from] std::io::Error),
    /// A scan's length is not a whole number of points.
    #[error(
        "{}: {bytes} bytes is not a whole number of points ({point} bytes each: {} as f32)",
        path.display(), columns(*point)
    )]
    Truncated {
        /// Path of the scan.
        path: PathBuf,
        /// Length of the file, in bytes.
        bytes: u64,
        /// Length of a point, in bytes: 16 for KITTI, 20 for nuScenes.
        point: usize,
    },
    /// A PLY header or body is not supported.
    #[error("PLY: {0}")]
    Ply(#[from] PlyProblem),
    /// A column, an image or a camera does not fit the points or the depth map.
    #[error(transparent)]
    Size(#[from] SizeProblem),
}

/// A result with this crate's [`Error`].
pub type Result<T> = std::result::Result<T, Error>;

/// The values of a point in a binary scan with this point length.
fn columns(point: usize) -> &'static str {
    if point == 20 {
        "x, y, z, intensity, ring"
    } else {
        "x, y, z, intensity"
    }
}

impl Hint for Error {
    fn hint(&self) -> Option<String> {
        match self {
            Self::File(error) => error.hint(),
            Self::Stream(source) => Some(system_hint(source.kind()).into()),
            Self::Truncated { .. } => Some("copy or unpack the scan again: it is cut off".into()),
            Self::Ply(_) => Some(
                "give a PLY file in binary_little_endian with float x, y, z in its vertex element"
                    .into(),
            ),
            Self::Size(_) => None,
        }
    }
}

/// Why a PLY file cannot be read.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum PlyProblem {
    /// The file is not a PLY file.
    #[error("does not begin with 'ply'")]
    NoPly,
    /// The header is cut off.
    #[error("ends within its header")]
    HeaderCut,
    /// The header is not text.
    #[error("the header is not text")]
    NoText,
    /// The format is not supported.
    #[error("format '{0}', expected binary_little_endian")]
    Format(String),
    /// The header does not state the format.
    #[error("the header has no format line")]
    NoFormat,
    /// The header has no vertex element.
    #[error("the header has no vertex element")]
    NoVertices,
    /// The number of vertices is not a number.
    #[error("'{0}' is not a number of vertices")]
    Count(String),
    /// Another element comes before the vertices.
    #[error("element '{0}' comes before vertex, expected vertex as the first element")]
    Order(String),
    /// A vertex has a list property.
    #[error("the vertex element has a list property")]
    List,
    /// A property has an unknown type.
    #[error("property {name}: unknown type '{kind}'")]
    Type {
        /// The property's name.
        name: String,
        /// The property's type.
        kind: String,
    },
    /// The vertex element lacks a property.
    #[error("the vertex element has no property '{0}'")]
    NoProperty(&'static str),
    /// A header line is not known.
    #[error("unknown header line '{0}'")]
    Line(String),
    /// The file ends within its vertices.
    #[error("ends before vertex {vertex} of the {vertices} its header announces")]
    Cut {
        /// Index of the first missing vertex.
        vertex: usize,
        /// Number of vertices according to the header.
        vertices: usize,
    },
}
