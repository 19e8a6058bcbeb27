//! What the system says of a file or folder.

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
    /// The system gave another reason.
    #[error("{}: {source}", path.display())]
    Io {
        /// The file or folder.
        path: PathBuf,
        /// What the system said.
        source: io::Error,
    },
}

impl FileError {
    /// An error of the system's at `path`.
    #[must_use]
    pub fn new(path: &Path, source: io::Error) -> Self {
        let path = path.to_owned();
        match source.kind() {
            ErrorKind::NotFound => Self::NoSuchPath { path },
            _ => Self::Io { path, source },
        }
    }

    /// The same error with `to` in place of `from` in its path: what was written aside is gone when the error is read.
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
