use deepfusion_hint::{Hint, count_of, system_hint};

/// What can go wrong while a picture or a report is made.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum Error {
    /// Two things that belong together are of different sizes.
    #[error("{what} has {}, expected {}×{}", count_of(*found, "value"), expected.0, expected.1)]
    Size {
        /// What does not fit.
        what: &'static str,
        /// How many values it has.
        found: usize,
        /// How many it should have: so many a row, and rows.
        expected: (u32, u32),
    },
    /// A picture cannot be encoded.
    #[error("a picture of the report cannot be encoded")]
    Encode(#[from] image::ImageError),
    /// A run's log that cannot be shown.
    #[error("{}: {problem}", path.display())]
    Log {
        /// The file.
        path: std::path::PathBuf,
        /// What is wrong with it.
        problem: LogProblem,
    },
    /// A file cannot be read or written.
    #[error(transparent)]
    File(#[from] deepfusion_images::Error),
}

/// Why a file is not the log of a run.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum LogProblem {
    /// It is no table: what the parser said.
    #[error(transparent)]
    Csv(#[from] csv::Error),
    /// It lacks a column.
    #[error("no column `{0}`")]
    NoColumn(&'static str),
    /// A line before the last is not whole.
    #[error("line {0}: no step, or too few cells")]
    Line(u64),
}

/// A result of this crate.
pub type Result<T> = std::result::Result<T, Error>;

impl Hint for Error {
    fn hint(&self) -> Option<String> {
        match self {
            Self::File(inner) => inner.hint(),
            Self::Log { .. } => Some("it should be the log.csv of a run's folder".into()),
            Self::Encode(image::ImageError::IoError(source)) => {
                Some(system_hint(source.kind()).into())
            }
            Self::Size { .. } | Self::Encode(_) => None,
        }
    }
}

/// Fails where `found` is not width × height.
pub(crate) fn require_size(what: &'static str, found: usize, expected: (u32, u32)) -> Result<()> {
    if found == expected.0 as usize * expected.1 as usize {
        return Ok(());
    }
    Err(Error::Size {
        what,
        found,
        expected,
    })
}
