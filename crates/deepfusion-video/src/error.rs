use crate::problem::{CameraModeProblem, PacketProblem, ProgramProblem, quoted};
use deepfusion_hint::{Hint, count_of, system_hint};
use std::io::ErrorKind;
use std::path::{Path, PathBuf};
use std::time::Duration;

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
    #[error("{}: cannot be decoded: {source}", path.display())]
    Picture {
        /// The picture.
        path: PathBuf,
        /// Why not.
        source: image::ImageError,
    },
    /// ffmpeg or ffprobe failed, or is not there.
    #[error("{}: {program} {problem}", path.display())]
    Program {
        /// The file or address that it should have read or written.
        path: PathBuf,
        /// The program.
        program: &'static str,
        /// What happened.
        problem: ProgramProblem,
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
        problem: PacketProblem,
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
    /// Frames that could not be decoded when the first of them was asked for: they are not decoded anew for each.
    #[error("{said}")]
    NotDecoded {
        /// What was wrong then.
        said: String,
        /// What to do about it.
        hint: Option<String>,
    },
    /// Nothing says which camera is meant.
    #[error("{address} names no camera")]
    NoCameraName {
        /// What was given.
        address: String,
    },
    /// What a camera is to give is not understood.
    #[error("{address}: {problem}")]
    CameraMode {
        /// The camera, with what is asked of it.
        address: String,
        /// Why not.
        #[source]
        problem: CameraModeProblem,
    },
    /// A live source gives no frame for longer than is waited for.
    #[error("{address}: ffmpeg gave no frame for {} s{}{}", waited.as_secs_f64(), after(*frames), quoted(said))]
    Silent {
        /// The source, without its password.
        address: String,
        /// For how long.
        waited: Duration,
        /// How many frames had come.
        frames: u64,
        /// What ffmpeg said last.
        said: Vec<String>,
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
            Self::File { source, .. } => return Some(system_hint(source.kind()).into()),
            Self::Picture { .. } => "PNG and JPEG are read",
            Self::Program { problem, .. } => return problem.hint(),
            Self::Packet { problem, .. } => return problem.hint(),
            Self::NotDecoded { hint, .. } => return hint.clone(),
            Self::Codec { .. } => {
                "h264, h265 (hevc), vp9 and av1 are read: encode the stream as one of them, or record images"
            }
            Self::NoCameraName { .. } => {
                "the camera's number or name stands behind it: camera:0 is the first"
            }
            Self::CameraMode { .. } => {
                "any of size=1920x1080, fps=30 and format=mjpeg may stand behind the camera's `?`, with & between them"
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

/// How many frames had come before, if any had.
fn after(frames: u64) -> String {
    match frames {
        0 => String::new(),
        n => format!(", after {}", count_of(n, "frame")),
    }
}
