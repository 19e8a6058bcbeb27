use deepfusion_fs::FileError;
use deepfusion_hint::Hint;
use std::path::PathBuf;

use crate::ShapeProblem;

/// Why a model cannot be used, or fails.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum Error {
    /// The file cannot be read.
    #[error(transparent)]
    File(#[from] FileError),
    /// The ONNX Runtime library is missing, or it refuses the model.
    #[error("{}: {source}", path.display())]
    Runtime {
        /// Path of the model.
        path: PathBuf,
        /// The error of the library.
        source: deepfusion_onnx::Error,
    },
    /// The inputs and outputs match no known kind of model.
    #[error("{}: not a known kind of instance model: {reason}", path.display())]
    Shape {
        /// Path of the model.
        path: PathBuf,
        /// What does not match.
        reason: ShapeProblem,
    },
    /// The model has no class of this name.
    #[error("{}: no class `{class}`", path.display())]
    Class {
        /// Path of the model.
        path: PathBuf,
        /// The class that was requested.
        class: String,
        /// Names of the model's classes.
        known: Vec<String>,
    },
}

/// [`std::result::Result`] with this crate's error.
pub type Result<T> = std::result::Result<T, Error>;

impl Hint for Error {
    fn hint(&self) -> Option<String> {
        match self {
            Self::File(error) => error.hint(),
            Self::Runtime { source, .. } => source.hint(),
            Self::Shape { reason, .. } => reason.hint(),
            Self::Class { known, .. } if known.is_empty() => {
                Some("select no classes to use all of them: the model has no class names".into())
            }
            Self::Class { known, .. } => Some(format!("choose among {}", known.join(", "))),
        }
    }
}
