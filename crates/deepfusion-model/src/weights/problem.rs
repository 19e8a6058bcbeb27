//! Why a file holds no weights.

use safetensors::tensor::SafeTensorError;

/// Why a file is no weights file, or cannot become one.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum FormatProblem {
    /// It has no bytes.
    #[error("the file is empty")]
    Empty,
    /// It begins like none of the known formats.
    #[error("it starts with the bytes {start:02x?}")]
    Unknown {
        /// Its first bytes.
        start: Vec<u8>,
    },
    /// PyTorch's format, which is read elsewhere.
    #[error("a PyTorch file, where safetensors are expected")]
    PyTorch,
    /// It is shorter than it says, as a partial download is.
    #[error("the file ends within its header or its tensors")]
    CutOff,
    /// Nothing in it is a tensor of floats.
    #[error("it holds no float tensors")]
    NoTensors,
    /// A header of safetensors that is not one.
    #[error("{0}")]
    Header(#[source] serde_json::Error),
    /// A tensor whose values are not as many as its shape says.
    #[error("tensor `{name}`: {source}")]
    Tensor {
        /// Its name.
        name: String,
        /// What the format's library says.
        source: Box<SafeTensorError>,
    },
    /// Tensors that do not make a file.
    #[error("{0}")]
    Unwritten(#[source] Box<SafeTensorError>),
    /// What the reader of another format says.
    #[error("{0}")]
    Reader(#[source] Box<dyn std::error::Error + Send + Sync>),
}
