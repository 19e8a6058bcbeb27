//! Why a file or folder could not be used, as the system reports it.

use std::io::{self, ErrorKind};
use std::path::{Path, PathBuf};

use deepfusion_hint::{Hint, system_hint};

use crate::names::moved_path;

/// A file or folder that could not be opened, read or written.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum FileError {
    /// There is nothing at the path.
    #[error("{}: no such file or folder", path.display())]
    NoSuchPath {
        /// The path given.
        path: PathBuf,
    },
    /// The system gave another error.
    #[error("{}: {source}", path.display())]
    Io {
        /// Path of the file or folder.
        path: PathBuf,
        /// The system's error.
        source: io::Error,
    },
}

impl FileError {
    /// The system's error `source` at `path`.
    #[must_use]
    pub fn new(path: &Path, source: io::Error) -> Self {
        let path = path.to_owned();
        match source.kind() {
            ErrorKind::NotFound => Self::NoSuchPath { path },
            _ => Self::Io { path, source },
        }
    }

    /// The same error with `from` replaced by `to` at the start of its path. When the error is read, the temporary file is gone.
    #[must_use]
    pub fn moved(mut self, from: &Path, to: &Path) -> Self {
        let (Self::NoSuchPath { path } | Self::Io { path, .. }) = &mut self;
        *path = moved_path(std::mem::take(path), from, to);
        self
    }
}

impl Hint for FileError {
    fn hint(&self) -> Option<String> {
        let kind = match self {
            Self::NoSuchPath { .. } => ErrorKind::NotFound,
            Self::Io { source, .. } => source.kind(),
        };
        Some(system_hint(kind).into())
    }
}
