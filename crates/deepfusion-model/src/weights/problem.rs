//! Why a file has no readable weights.

use safetensors::tensor::SafeTensorError;

/// Why a file is not a weights file, or cannot be written as one.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum FormatProblem {
    /// The file has no bytes.
    #[error("the file is empty")]
    Empty,
    /// The file starts like none of the known formats.
    #[error("it starts with the bytes {start:02x?}")]
    Unknown {
        /// The file's first bytes.
        start: Vec<u8>,
    },
    /// A PyTorch file, which another function reads.
    #[error("it is a PyTorch file, expected safetensors")]
    PyTorch,
    /// The file is shorter than its header states, like a partial download.
    #[error("the file ends within its header or its tensors")]
    CutOff,
    /// The file has no tensor of floats.
    #[error("it has no float tensors")]
    NoTensors,
    /// A safetensors header that cannot be parsed.
    #[error("{0}")]
    Header(#[source] serde_json::Error),
    /// A tensor whose number of values does not match its shape.
    #[error("tensor `{name}`: {source}")]
    Tensor {
        /// The tensor's name.
        name: String,
        /// The safetensors library's message.
        source: Box<SafeTensorError>,
    },
    /// Tensors that cannot be written to a file.
    #[error("{0}")]
    Unwritten(#[source] Box<SafeTensorError>),
    /// The message of another format's reader.
    #[error("{0}")]
    Reader(#[source] Box<dyn std::error::Error + Send + Sync>),
}
