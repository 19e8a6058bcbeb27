//! Why a PLY file is not what is read.

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
