use deepfusion_hint::{Hint, count_of, system_hint};

/// What can go wrong when a picture or a report is made.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum Error {
    /// Two things that belong together differ in size.
    #[error("{what} has {}, expected {}x{}", count_of(*found, "value"), expected.0, expected.1)]
    Size {
        /// The part whose size is wrong.
        what: &'static str,
        /// Number of values it has.
        found: usize,
        /// Expected width and height.
        expected: (u32, u32),
    },
    /// A picture cannot be encoded.
    #[error("a picture of the report cannot be encoded")]
    Encode(#[from] image::ImageError),
    /// A run's log cannot be shown.
    #[error("{}: {problem}", path.display())]
    Log {
        /// Path of the file.
        path: std::path::PathBuf,
        /// What is wrong with the file.
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
    /// The file is not a table; the parser's error.
    #[error(transparent)]
    Csv(#[from] csv::Error),
    /// A column is missing.
    #[error("no column `{0}`")]
    NoColumn(&'static str),
    /// A line before the last is incomplete.
    #[error("line {0}: no step, or too few cells")]
    Line(u64),
}

/// A result of this crate.
pub type Result<T> = std::result::Result<T, Error>;

impl Hint for Error {
    fn hint(&self) -> Option<String> {
        match self {
            Self::File(inner) => inner.hint(),
            Self::Log { .. } => Some("give the log.csv of a run's folder".into()),
            Self::Encode(image::ImageError::IoError(source)) => {
                Some(system_hint(source.kind()).into())
            }
            Self::Size { .. } | Self::Encode(_) => None,
        }
    }
}

/// An error unless `found` is width × height.
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
