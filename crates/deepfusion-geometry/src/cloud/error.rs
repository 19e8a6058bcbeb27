//! What can go wrong with a cloud or its file.

mod size;

pub use self::size::SizeProblem;

use deepfusion_hint::{Hint, system_hint};
use std::path::PathBuf;

/// What can go wrong with a cloud or its file.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum Error {
    /// A file could not be opened, read or written.
    #[error("{}: {source}", path.display())]
    File {
        /// The file.
        path: PathBuf,
        /// What the system said.
        source: std::io::Error,
    },
    /// Reading or writing a stream failed.
    #[error("point cloud: {0}")]
    Stream(#[from] std::io::Error),
    /// A scan's length is not a whole number of points.
    #[error(
        "{}: {bytes} bytes is not a whole number of points ({point} bytes each: {} as f32)",
        path.display(), columns(*point)
    )]
    Truncated {
        /// The scan.
        path: PathBuf,
        /// Its length.
        bytes: u64,
        /// The length of a point: KITTI's 16, nuScenes' 20.
        point: usize,
    },
    /// A PLY header or body is not what this reader takes.
    #[error("PLY: {0}")]
    Ply(#[from] PlyProblem),
    /// A column, an image or a camera does not fit the points or the depth map.
    #[error(transparent)]
    Size(#[from] SizeProblem),
}

/// A result with this crate's [`Error`].
pub type Result<T> = std::result::Result<T, Error>;

/// What a point of a binary scan of this length holds.
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
            Self::File { source, .. } | Self::Stream(source) => {
                Some(system_hint(source.kind()).into())
            }
            Self::Truncated { .. } => {
                Some("the scan was cut off while copying or unpacking: fetch it again".into())
            }
            Self::Ply(_) => Some(
                "readable are PLY files in binary_little_endian with float x, y, z in a vertex element".into(),
            ),
            Self::Size(_) => None,
        }
    }
}

/// Why a PLY file is not what is read.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum PlyProblem {
    /// It is no PLY file.
    #[error("does not begin with 'ply'")]
    NoPly,
    /// Its header is cut off.
    #[error("ends within its header")]
    HeaderCut,
    /// Its header is no text.
    #[error("the header is not text")]
    NoText,
    /// It has another format.
    #[error("format '{0}', expected binary_little_endian")]
    Format(String),
    /// It does not say its format.
    #[error("the header has no format line")]
    NoFormat,
    /// It has no vertices.
    #[error("the header has no vertex element")]
    NoVertices,
    /// The number of its vertices is none.
    #[error("'{0}' is not a number of vertices")]
    Count(String),
    /// Another element comes before the vertices.
    #[error("element '{0}' comes before vertex, which should be the first")]
    Order(String),
    /// A vertex has a list.
    #[error("a vertex with a list property")]
    List,
    /// A property has an unknown type.
    #[error("property {name}: unknown type '{kind}'")]
    Type {
        /// The property's name.
        name: String,
        /// Its type.
        kind: String,
    },
    /// A vertex lacks a property.
    #[error("a vertex without property '{0}'")]
    NoProperty(&'static str),
    /// A line of the header is unknown.
    #[error("header line '{0}' is not understood")]
    Line(String),
    /// It ends within its vertices.
    #[error("ends before vertex {vertex} of the {vertices} its header announces")]
    Cut {
        /// A vertex that is not there any more.
        vertex: usize,
        /// How many there should be.
        vertices: usize,
    },
}
