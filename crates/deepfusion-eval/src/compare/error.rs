use deepfusion_fs::FileError;
use deepfusion_hint::{Hint, system_hint};
use std::path::{Path, PathBuf};

/// What can go wrong while evaluations are read and put side by side.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum Error {
    /// A file or folder could not be opened, read or written.
    #[error(transparent)]
    File(#[from] FileError),
    /// A file that is no evaluation.
    #[error("{}: no evaluation: {reason}", path.display())]
    NotAnEvaluation {
        /// The file.
        path: PathBuf,
        /// Why.
        #[source]
        reason: EvaluationProblem,
    },
    /// A file of a newer program.
    #[error("{}: format version {found}, this program reads up to {}", path.display(), super::SAVED_VERSION)]
    Version {
        /// The file.
        path: PathBuf,
        /// Its version.
        found: u32,
    },
    /// A run that was never evaluated.
    #[error("{}: has no evaluation", path.display())]
    NotEvaluated {
        /// The run's folder.
        path: PathBuf,
    },
    /// A table that cannot be written as CSV.
    #[error("the tables cannot be written as CSV")]
    Csv(#[from] csv::Error),
    /// The table of published figures, which is part of the program.
    #[error("published.toml: {0}")]
    Published(#[source] PublishedProblem),
}

/// Why a file is no evaluation.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum EvaluationProblem {
    /// No JSON, or that of something else.
    #[error("{0}")]
    Json(#[from] serde_json::Error),
    /// Its version is not a number.
    #[error("format_version is not a number")]
    VersionNumber,
}

/// Why a text is no table of published figures.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum PublishedProblem {
    /// It cannot be read as one. What the parser says, without the line break that ends it.
    #[error("{}", .0.to_string().trim_end())]
    NotOne(Box<toml::de::Error>),
    /// A row that names a source or group that does not exist.
    #[error("`{method}` has no such source or group")]
    Reference {
        /// The row's method.
        method: String,
    },
}

/// A result of this module.
pub type Result<T> = std::result::Result<T, Error>;

impl Error {
    /// An error of the system's at `path`.
    pub(super) fn file(path: &Path, source: std::io::Error) -> Self {
        FileError::new(path, source).into()
    }
}

impl Hint for Error {
    fn hint(&self) -> Option<String> {
        match self {
            Self::File(error) => error.hint(),
            Self::NotAnEvaluation { .. } => Some(
                "give a run's folder, a file of its eval/ folder, or an evaluation as JSON".into(),
            ),
            Self::Version { .. } => {
                Some("use the program's version that wrote it, or evaluate again".into())
            }
            Self::NotEvaluated { .. } => Some("measure it first".into()),
            Self::Csv(error) => match error.kind() {
                csv::ErrorKind::Io(source) => Some(system_hint(source.kind()).into()),
                _ => None,
            },
            Self::Published(_) => None,
        }
    }
}
