//! Errors of showing results.

mod content;

pub use self::content::{ArrayProblem, ContentProblem, FolderKind};

use deepfusion_fs::FileError;
use deepfusion_hint::Hint;
use std::net::SocketAddr;
use std::path::PathBuf;
#[cfg(feature = "rerun")]
use {re_chunk::ChunkError, re_log_encoding::EncodeError};

/// A result of this crate.
pub type Result<T, E = Error> = std::result::Result<T, E>;

/// An error of showing results.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum Error {
    /// There is no file or folder at the path.
    #[error("{}: no such file or folder", path.display())]
    NoSuchFolder {
        /// The path given.
        path: PathBuf,
    },
    /// The path is a file.
    #[error("{}: not a folder", path.display())]
    NotAFolder {
        /// The path given.
        path: PathBuf,
    },
    /// The folder contains nothing that can be shown.
    #[error("{}: nothing to show: no NAME.json, NAME_depth.png, NAME_depth.npy or NAME_targets.json, and no training log", path.display())]
    NothingToShow {
        /// The folder.
        path: PathBuf,
    },
    /// A run and predictions, which cannot be compared.
    #[error("{}: contains {found}, which cannot be shown beside {expected}", path.display())]
    OtherKind {
        /// The second folder.
        path: PathBuf,
        /// What it contains.
        found: FolderKind,
        /// What the first contains.
        expected: FolderKind,
    },
    /// A training run, although frames are needed.
    #[error("{}: a training run has no frames", path.display())]
    NoFrames {
        /// The folder.
        path: PathBuf,
    },
    /// A file that was not completed, because the work was asked to stop.
    #[error("{}: not written: stopped after {done} of {}", path.display(), deepfusion_hint::count_of(*total, "frame"))]
    Stopped {
        /// The file that would have been written.
        path: PathBuf,
        /// Frames done.
        done: usize,
        /// Frames in all.
        total: usize,
    },
    /// A frame that cannot be written in the rerun viewer's format.
    #[cfg(feature = "rerun")]
    #[error("{}: cannot be written: {problem}", path.display())]
    Encoding {
        /// The file that would have been written.
        path: PathBuf,
        /// Why not.
        problem: EncodingProblem,
    },
    /// A file or folder cannot be read or written.
    #[error(transparent)]
    File(#[from] FileError),
    /// The content of a file does not match its name.
    #[error("{}: {problem}", path.display())]
    Content {
        /// The file.
        path: PathBuf,
        /// What is wrong with it.
        problem: ContentProblem,
    },
    /// A picture or a depth PNG cannot be read.
    #[error(transparent)]
    Picture(#[from] deepfusion_images::Error),
    /// Another program listens on the port.
    #[error("{address}: the port is in use")]
    PortInUse {
        /// The address that the server should listen on.
        address: SocketAddr,
    },
    /// The server cannot listen on the address.
    #[error("{address}: cannot listen on this address: {source}")]
    Listen {
        /// The address that the server should listen on.
        address: SocketAddr,
        /// The error of the system.
        source: std::io::Error,
    },
}

/// Why data cannot be written for the rerun viewer: the error of its libraries.
#[cfg(feature = "rerun")]
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum EncodingProblem {
    /// Writing failed.
    #[error(transparent)]
    Encode(#[from] EncodeError),
    /// A chunk could not be built.
    #[error(transparent)]
    Chunk(#[from] ChunkError),
}

#[cfg(feature = "rerun")]
impl EncodingProblem {
    /// The error for the file at `path`.
    pub(crate) fn of(self, path: &std::path::Path) -> Error {
        match self {
            Self::Encode(EncodeError::Write(source)) => Error::file(path, source),
            other => Error::Encoding {
                path: path.to_owned(),
                problem: other,
            },
        }
    }
}

impl Error {
    /// An error of the system for a file.
    pub(crate) fn file(path: &std::path::Path, source: std::io::Error) -> Self {
        FileError::new(path, source).into()
    }

    /// A file whose content is wrong.
    pub(crate) fn content(path: &std::path::Path, problem: impl Into<ContentProblem>) -> Self {
        Self::Content {
            path: path.to_owned(),
            problem: problem.into(),
        }
    }
}

impl Hint for Error {
    fn hint(&self) -> Option<String> {
        match self {
            Self::NoSuchFolder { .. } => Some("give a folder of predictions or of targets".into()),
            Self::NotAFolder { path } => {
                let folder = path.parent().filter(|p| !p.as_os_str().is_empty());
                let folder = folder.unwrap_or(std::path::Path::new("."));
                Some(format!("give its folder: {}", folder.display()))
            }
            Self::NothingToShow { .. } => {
                Some("predict some images, find targets or train a network first".into())
            }
            Self::OtherKind { .. } => {
                Some("give two folders of predictions, or two of training runs".into())
            }
            Self::NoFrames { .. } => Some("give a folder of predictions or of targets".into()),
            Self::File(error) => error.hint(),
            Self::Content { .. } | Self::Stopped { .. } => None,
            #[cfg(feature = "rerun")]
            Self::Encoding { .. } => None,
            Self::Picture(error) => error.hint(),
            Self::PortInUse { .. } => Some("give another port, or port 0 for any free one".into()),
            Self::Listen { source, .. } => Some(match source.kind() {
                std::io::ErrorKind::PermissionDenied => {
                    "give port 8765: ports below 1024 are reserved for the system".into()
                }
                _ => "give an address of this machine, such as 127.0.0.1 or 0.0.0.0".into(),
            }),
        }
    }
}
