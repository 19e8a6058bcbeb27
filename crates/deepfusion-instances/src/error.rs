use deepfusion_hint::Hint;
use std::path::PathBuf;

use crate::ShapeProblem;

/// What can go wrong with a model of instances.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum Error {
    /// The file cannot be read.
    #[error("{}: {source}", path.display())]
    File {
        /// The file.
        path: PathBuf,
        /// Why.
        source: std::io::Error,
    },
    /// The library is missing, or refuses the model.
    #[error("{}: {source}", path.display())]
    Runtime {
        /// The model.
        path: PathBuf,
        /// What it says.
        source: deepfusion_onnx::Error,
    },
    /// Inputs or outputs that no known kind of model has.
    #[error("{}: no model of instances that is known: {reason}", path.display())]
    Shape {
        /// The model.
        path: PathBuf,
        /// What it has.
        reason: ShapeProblem,
    },
    /// A class that the model does not know.
    #[error("{}: no class `{class}`", path.display())]
    Class {
        /// The model.
        path: PathBuf,
        /// The class that was asked for.
        class: String,
        /// Those it knows.
        known: Vec<String>,
    },
}

/// [`std::result::Result`] with this crate's error.
pub type Result<T> = std::result::Result<T, Error>;

impl Hint for Error {
    fn hint(&self) -> Option<String> {
        match self {
            Self::File { .. } => {
                Some("a model is a file that a training framework exported as ONNX".into())
            }
            Self::Runtime { source, .. } => source.hint(),
            Self::Shape { reason, .. } => reason.hint(),
            Self::Class { known, .. } if known.is_empty() => {
                Some("the file names no classes: ask for none, and all are taken".into())
            }
            Self::Class { known, .. } => Some(format!("it knows {}", known.join(", "))),
        }
    }
}
