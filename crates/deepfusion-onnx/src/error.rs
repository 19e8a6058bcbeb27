use deepfusion_hint::{Hint, count_of};
use std::path::PathBuf;

use crate::{LibraryProblem, ModelProblem, NodeProblem};

/// What can go wrong when a model is written, read or run.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum Error {
    /// Bytes that are no ONNX file.
    #[error("not an ONNX file: {0}")]
    Decode(#[from] prost::DecodeError),
    /// An operation that cannot be written, or that is not one this program writes.
    #[error("ONNX node `{name}` ({op}): {reason}")]
    Node {
        /// The node's name.
        name: String,
        /// Its operator.
        op: String,
        /// What is wrong with it.
        reason: NodeProblem,
    },
    /// A part of the model other than a node.
    #[error("ONNX model, {part}: {reason}")]
    Model {
        /// Which part.
        part: &'static str,
        /// What is wrong with it.
        reason: ModelProblem,
    },
    /// A network that does not fit together, or an image size that it cannot work on.
    #[error(transparent)]
    Network(#[from] deepfusion_infer::Error),
    /// A file too large for the format.
    #[error("the model has {bytes} bytes; an ONNX file can hold {most}")]
    TooLarge {
        /// Size of the file that would be needed.
        bytes: usize,
        /// The most that fits.
        most: usize,
    },
    /// No ONNX Runtime on this machine.
    #[error("no ONNX Runtime library found: looked at {}", list(searched))]
    NoLibrary {
        /// Where it was looked for.
        searched: Vec<PathBuf>,
    },
    /// A file that is no ONNX Runtime library, or not one that can be used.
    #[error("{}: no ONNX Runtime that can be used: {reason}", path.display())]
    Library {
        /// The file.
        path: PathBuf,
        /// Why.
        #[source]
        reason: LibraryProblem,
    },
    /// What ONNX Runtime itself refuses.
    #[error("ONNX Runtime cannot {action}: {source}")]
    Runtime {
        /// What was tried.
        action: &'static str,
        /// What it says.
        source: Box<dyn std::error::Error + Send + Sync>,
    },
    /// An image or a buffer of another size than the model's.
    #[error("{what} of {}, expected {expected}", count_of(*found, "value"))]
    Length {
        /// Which one.
        what: &'static str,
        /// Values expected.
        expected: usize,
        /// Values given.
        found: usize,
    },
}

impl Hint for Error {
    fn hint(&self) -> Option<String> {
        let hint = match self {
            Self::Decode(_) => "is it complete? A partial copy ends early",
            Self::Node { .. } | Self::Model { .. } => "only files that this version wrote are read",
            Self::TooLarge { .. } => "choose a network with fewer weights",
            Self::NoLibrary { .. } => {
                "`pip install onnxruntime` is enough, or set ORT_DYLIB_PATH to libonnxruntime.so of 1.17 or later"
            }
            Self::Library { .. } => {
                "give libonnxruntime.so (onnxruntime.dll, libonnxruntime.dylib) of ONNX Runtime 1.17 or later, built for this processor"
            }
            Self::Network(_) | Self::Runtime { .. } | Self::Length { .. } => return None,
        };
        Some(hint.to_owned())
    }
}

fn list(paths: &[PathBuf]) -> String {
    let names: Vec<_> = paths.iter().map(|p| p.display().to_string()).collect();
    names.join(", ")
}
