use deepfusion_hint::Hint;
use std::io::ErrorKind;
use std::path::{Path, PathBuf};

/// What can go wrong with a video or a live source.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum Error {
    /// A file could not be opened, read or written.
    #[error("{}: {}", path.display(), said(source))]
    File {
        /// The file.
        path: PathBuf,
        /// What the system said.
        source: std::io::Error,
    },
    /// A picture cannot be read.
    #[error("{}: {problem}", path.display())]
    Picture {
        /// The picture.
        path: PathBuf,
        /// Why not.
        problem: String,
    },
    /// ffmpeg or ffprobe failed, or is not there.
    #[error("{}: {program} {problem}", path.display())]
    Program {
        /// The file or address that it should have read or written.
        path: PathBuf,
        /// The program.
        program: &'static str,
        /// What happened.
        problem: String,
        /// What to do.
        remedy: &'static str,
    },
    /// A packet of a stream cannot be decoded.
    #[error("{}: {stream}, message {number}: {problem}", path.display())]
    Packet {
        /// The recording.
        path: PathBuf,
        /// The stream's name in it.
        stream: String,
        /// Which of the stream's messages, counted from 0.
        number: u64,
        /// Why not.
        problem: String,
        /// What to do.
        remedy: &'static str,
    },
    /// A stream of a codec that is not read.
    #[error("{}: {stream}: a video of format `{format}` is not read", path.display())]
    Codec {
        /// The recording.
        path: PathBuf,
        /// The stream's name in it.
        stream: String,
        /// The format's name.
        format: String,
    },
    /// A live source gives no frame for longer than is waited for.
    #[error("{address}: ffmpeg {problem}")]
    Silent {
        /// The source, without its password.
        address: String,
        /// For how long, after how many frames, and what ffmpeg said.
        problem: String,
    },
}

/// A result with this crate's [`Error`].
pub type Result<T> = std::result::Result<T, Error>;

impl Error {
    /// An error of the system's at `path`.
    #[must_use]
    pub fn file(path: &Path, source: std::io::Error) -> Self {
        let path = path.to_owned();
        Self::File { path, source }
    }
}

impl Hint for Error {
    fn hint(&self) -> Option<String> {
        let text = match self {
            Self::File { source, .. } => match source.kind() {
                ErrorKind::NotFound => "check the spelling, and that the disk is mounted",
                ErrorKind::StorageFull => "the disk is full: free some space and run again",
                ErrorKind::PermissionDenied => "check the permissions of the file and its folder",
                _ => return None,
            },
            Self::Picture { .. } => "PNG and JPEG are read",
            Self::Program { remedy, .. } | Self::Packet { remedy, .. } => remedy,
            Self::Codec { .. } => {
                "h264, h265 (hevc), vp9 and av1 are read: encode the stream as one of them, or record images"
            }
            Self::Silent { .. } => "is the source sending? A longer timeout waits for it",
        };
        Some(text.to_owned())
    }
}

/// The system's words, but for the most usual of them.
fn said(error: &std::io::Error) -> String {
    match error.kind() {
        ErrorKind::NotFound => "no such file or folder".into(),
        _ => error.to_string(),
    }
}
