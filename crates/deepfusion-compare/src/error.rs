use deepfusion_hint::Hint;
use std::path::PathBuf;

/// What can go wrong while evaluations are read and put side by side.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum Error {
    /// A file that cannot be read or written.
    #[error(transparent)]
    Data(#[from] deepfusion_data::Error),
    /// A file that is no evaluation.
    #[error("{}: no evaluation: {what}", path.display())]
    NotAnEvaluation {
        /// The file.
        path: PathBuf,
        /// Why.
        what: String,
    },
    /// A file of a newer program.
    #[error("{}: format version {found}, this program reads up to {}", path.display(), crate::SAVED_VERSION)]
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
    Published(String),
}

/// A result of this crate.
pub type Result<T> = std::result::Result<T, Error>;

impl Hint for Error {
    fn hint(&self) -> Option<String> {
        match self {
            Self::Data(inner) => inner.hint(),
            Self::NotAnEvaluation { .. } => Some(
                "give a run's folder, a file of its eval/ folder, or an evaluation as JSON".into(),
            ),
            Self::Version { .. } => {
                Some("use the program's version that wrote it, or evaluate again".into())
            }
            Self::NotEvaluated { .. } => Some("measure it first: `deepfusion eval`".into()),
            Self::Csv(_) | Self::Published(_) => None,
        }
    }
}
