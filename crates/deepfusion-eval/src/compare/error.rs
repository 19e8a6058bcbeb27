use deepfusion_fs::FileError;
use deepfusion_hint::{Hint, system_hint};
use std::path::{Path, PathBuf};

/// What can go wrong when evaluations are read and compared.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum Error {
    /// A file or folder could not be opened, read or written.
    #[error(transparent)]
    File(#[from] FileError),
    /// A file that does not contain an evaluation.
    #[error("{}: not an evaluation: {reason}", path.display())]
    NotAnEvaluation {
        /// Path of the file.
        path: PathBuf,
        /// Why it is not an evaluation.
        #[source]
        reason: EvaluationProblem,
    },
    /// A file written by a newer version of the program.
    #[error("{}: format version {found}, this program reads up to {}", path.display(), super::SAVED_VERSION)]
    Version {
        /// Path of the file.
        path: PathBuf,
        /// The file's format version.
        found: u32,
    },
    /// A run that was never evaluated.
    #[error("{}: has no evaluation", path.display())]
    NotEvaluated {
        /// Path of the run's folder.
        path: PathBuf,
    },
    /// A table that cannot be written as CSV.
    #[error("the tables cannot be written as CSV")]
    Csv(#[from] csv::Error),
    /// The table of published figures, which is embedded in the program, is invalid.
    #[error("published.toml: {0}")]
    Published(#[source] PublishedProblem),
}

/// Why a file is not an evaluation.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum EvaluationProblem {
    /// Not JSON, or JSON of something else.
    #[error("{0}")]
    Json(#[from] serde_json::Error),
    /// The format version is not a number.
    #[error("format_version is not a number")]
    VersionNumber,
}

/// Why a text is not a table of published figures.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum PublishedProblem {
    /// It does not parse. Contains the parser's message without its final line break.
    #[error("{}", .0.to_string().trim_end())]
    NotOne(Box<toml::de::Error>),
    /// A row names a source or group that does not exist.
    #[error("row `{method}` names a source or group that does not exist")]
    Reference {
        /// The row's method.
        method: String,
    },
}

/// A result with this module's [`Error`].
pub type Result<T> = std::result::Result<T, Error>;

impl Error {
    /// A system error at `path`.
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
                Some("use the version that wrote the file, or evaluate again".into())
            }
            Self::NotEvaluated { .. } => Some("evaluate it first".into()),
            Self::Csv(error) => match error.kind() {
                csv::ErrorKind::Io(source) => Some(system_hint(source.kind()).into()),
                _ => None,
            },
            Self::Published(_) => None,
        }
    }
}
