//! What can go wrong with showing results.

mod content;

pub use self::content::{ArrayProblem, ContentProblem, FolderKind};

use deepfusion_hint::{Hint, system_hint};
use std::net::SocketAddr;
use std::path::PathBuf;
#[cfg(feature = "rerun")]
use {re_chunk::ChunkError, re_log_encoding::EncodeError};

/// A result of this crate.
pub type Result<T, E = Error> = std::result::Result<T, E>;

/// What can go wrong with showing results.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum Error {
    /// There is nothing at the path.
    #[error("{}: no such folder", path.display())]
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
    /// The folder holds nothing that can be shown.
    #[error("{}: nothing to show there: no NAME.json, NAME_depth.png, NAME_depth.npy or NAME_targets.json, and no training log", path.display())]
    NothingToShow {
        /// The folder.
        path: PathBuf,
    },
    /// A run and predictions, where two of a kind are needed to be compared.
    #[error("{}: holds {found}, which cannot stand beside {expected}", path.display())]
    OtherKind {
        /// The second folder.
        path: PathBuf,
        /// What it holds.
        found: FolderKind,
        /// What the first holds.
        expected: FolderKind,
    },
    /// A training run, where frames are needed.
    #[error("{}: a training run has no frames", path.display())]
    NoFrames {
        /// The folder.
        path: PathBuf,
    },
    /// A file that was not written to its end, because somebody asked to stop.
    #[error("{}: not written: stopped after {done} of {}", path.display(), deepfusion_hint::count_of(*total, "frame"))]
    Stopped {
        /// The file that would have been written.
        path: PathBuf,
        /// Frames done.
        done: usize,
        /// Frames in all.
        total: usize,
    },
    /// A frame that another viewer's format cannot hold.
    #[cfg(feature = "rerun")]
    #[error("{}: cannot be written: {problem}", path.display())]
    Encoding {
        /// The file that would have been written.
        path: PathBuf,
        /// Why.
        problem: EncodingProblem,
    },
    /// A file or folder cannot be read or written.
    #[error("{}: {source}", path.display())]
    File {
        /// The file.
        path: PathBuf,
        /// What the system said.
        source: std::io::Error,
    },
    /// A file is not what its name says.
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
    /// Another program listens there.
    #[error("{address}: the port is in use")]
    PortInUse {
        /// Where the server was to listen.
        address: SocketAddr,
    },
    /// The server cannot listen there.
    #[error("{address}: cannot listen there: {source}")]
    Listen {
        /// Where the server was to listen.
        address: SocketAddr,
        /// What the system said.
        source: std::io::Error,
    },
}

/// Why something cannot be logged: what the viewer's own libraries said.
#[cfg(feature = "rerun")]
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum EncodingProblem {
    /// It cannot be written.
    #[error(transparent)]
    Encode(#[from] EncodeError),
    /// It cannot be put together.
    #[error(transparent)]
    Chunk(#[from] ChunkError),
}

#[cfg(feature = "rerun")]
impl EncodingProblem {
    /// The failure of a file.
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
    /// An error of the system, named by file.
    pub(crate) fn file(path: &std::path::Path, source: std::io::Error) -> Self {
        Self::File {
            path: path.to_owned(),
            source,
        }
    }

    /// A file that is not what it should be.
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
            Self::NothingToShow { .. } => Some(
                "make something to look at first: depth of images, targets or a training run"
                    .into(),
            ),
            Self::OtherKind { .. } => {
                Some("give two folders of predictions, or two of training runs".into())
            }
            Self::NoFrames { .. } => Some("give a folder of predictions or of targets".into()),
            Self::File { source, .. } => Some(system_hint(source.kind()).into()),
            Self::Content { .. } | Self::Stopped { .. } => None,
            #[cfg(feature = "rerun")]
            Self::Encoding { .. } => None,
            Self::Picture(error) => error.hint(),
            Self::PortInUse { .. } => {
                Some("give another port, or port 0 for any that is free".into())
            }
            Self::Listen { source, .. } => Some(match source.kind() {
                std::io::ErrorKind::PermissionDenied => {
                    "ports below 1024 belong to the system: give 8765".into()
                }
                _ => "give an address of this machine, such as 127.0.0.1 or 0.0.0.0".into(),
            }),
        }
    }
}
