use deepfusion_hint::{Hint, count_of};
use std::path::PathBuf;

use crate::{LibraryProblem, ModelProblem, NodeProblem};

/// What can go wrong when a model is written, read or run.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum Error {
    /// The bytes are not an ONNX file.
    #[error("not an ONNX file: {0}")]
    Decode(#[from] prost::DecodeError),
    /// An operation cannot be written, or is not one that this program writes.
    #[error("ONNX node `{name}` ({op}): {reason}")]
    Node {
        /// Name of the node.
        name: String,
        /// Operator of the node.
        op: String,
        /// What is wrong with the node.
        reason: NodeProblem,
    },
    /// A part of the model other than a node is wrong.
    #[error("ONNX model, {part}: {reason}")]
    Model {
        /// Name of the part.
        part: &'static str,
        /// What is wrong with the part.
        reason: ModelProblem,
    },
    /// The network is inconsistent, or cannot run on this image size.
    #[error(transparent)]
    Network(#[from] deepfusion_infer::Error),
    /// The file is too large for the format.
    #[error("the model has {bytes} bytes, expected at most {most} in an ONNX file")]
    TooLarge {
        /// Size of the file that would be needed, bytes.
        bytes: usize,
        /// Largest possible size, bytes.
        most: usize,
    },
    /// There is no ONNX Runtime on this machine.
    #[error("no ONNX Runtime library found in {}", list(searched))]
    NoLibrary {
        /// The folders that were searched.
        searched: Vec<PathBuf>,
    },
    /// The file is not an ONNX Runtime library, or not a usable one.
    #[error("{}: not a usable ONNX Runtime library: {reason}", path.display())]
    Library {
        /// Path of the file.
        path: PathBuf,
        /// Why it is not usable.
        #[source]
        reason: LibraryProblem,
    },
    /// ONNX Runtime itself returned an error.
    #[error("ONNX Runtime cannot {action}: {source}")]
    Runtime {
        /// The attempted action.
        action: &'static str,
        /// Its message.
        source: Box<dyn std::error::Error + Send + Sync>,
    },
    /// An image or a buffer has another size than the model needs.
    #[error("{what} of {}, expected {expected}", count_of(*found, "value"))]
    Length {
        /// Name of the image or buffer.
        what: &'static str,
        /// Expected number of values.
        expected: usize,
        /// Given number of values.
        found: usize,
    },
}

impl Hint for Error {
    fn hint(&self) -> Option<String> {
        let hint = match self {
            Self::Decode(_) => "check that the file is complete: a partial copy ends early",
            Self::Node { .. } | Self::Model { .. } => {
                "export the network again: only files written by this version are read"
            }
            Self::TooLarge { .. } => "choose a network with fewer weights",
            Self::NoLibrary { .. } => {
                "run `pip install onnxruntime`, or set ORT_DYLIB_PATH to libonnxruntime.so of version 1.17 or later"
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
