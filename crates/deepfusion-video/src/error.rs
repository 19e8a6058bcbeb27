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
    #[error("{}: {}", path.display(), message_of(source))]
    File {
        /// Path of the file.
        path: PathBuf,
        /// The system's error.
        source: std::io::Error,
    },
    /// A picture cannot be read.
    #[error("{}: cannot be decoded: {source}", path.display())]
    Picture {
        /// Path of the picture.
        path: PathBuf,
        /// The decoder's error.
        source: image::ImageError,
    },
    /// ffmpeg or ffprobe failed, or is not installed.
    #[error("{}: {program} {problem}", path.display())]
    Program {
        /// The file or address that it should have read or written.
        path: PathBuf,
        /// Name of the program.
        program: &'static str,
        /// What happened.
        problem: ProgramProblem,
    },
    /// A packet of a stream cannot be decoded.
    #[error("{}: {stream}, message {number}: {problem}", path.display())]
    Packet {
        /// Path of the recording.
        path: PathBuf,
        /// Name of the stream in the recording.
        stream: String,
        /// Number of the message in the stream, counted from 0.
        number: u64,
        /// Why it cannot be decoded.
        problem: PacketProblem,
    },
    /// The codec of a stream is not supported.
    #[error("{}: {stream}: video format `{format}` is not supported", path.display())]
    Codec {
        /// Path of the recording.
        path: PathBuf,
        /// Name of the stream in the recording.
        stream: String,
        /// Name of the format.
        format: String,
    },
    /// Frames could not be decoded when the first was requested. They are not decoded again for each frame.
    #[error("{message}")]
    NotDecoded {
        /// The message of that error.
        message: String,
        /// The hint of that error.
        hint: Option<String>,
    },
    /// The address does not say which camera is meant.
    #[error("{address} does not name a camera")]
    NoCameraName {
        /// The address.
        address: String,
    },
    /// The settings of a camera are not understood.
    #[error("{address}: {problem}")]
    CameraMode {
        /// The camera with its settings.
        address: String,
        /// What is wrong with the settings.
        #[source]
        problem: CameraModeProblem,
    },
    /// A live source sends no frame within the timeout.
    #[error("{address}: ffmpeg gave no frame for {} s{}{}", waited.as_secs_f64(), after(*frames), quoted(lines))]
    Silent {
        /// Address of the source, without its password.
        address: String,
        /// The timeout.
        waited: Duration,
        /// Number of frames received before.
        frames: u64,
        /// The last lines that ffmpeg printed.
        lines: Vec<String>,
    },
}

/// A result with this crate's [`Error`].
pub type Result<T> = std::result::Result<T, Error>;

impl Error {
    /// An error of the operating system about `path`.
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
            Self::Picture { .. } => "replace it with a PNG or JPEG image",
            Self::Program { problem, .. } => return problem.hint(),
            Self::Packet { problem, .. } => return problem.hint(),
            Self::NotDecoded { hint, .. } => return hint.clone(),
            Self::Codec { .. } => {
                "encode the stream as h264, h265 (hevc), vp9 or av1, or record images"
            }
            Self::NoCameraName { .. } => {
                "give the camera's number or name after it: camera:0 is the first"
            }
            Self::CameraMode { .. } => {
                "give any of size=1920x1080, fps=30 and format=mjpeg after the camera's `?`, separated by &"
            }
            Self::Silent { .. } => "check that the source is sending, or set a longer timeout",
        };
        Some(text.to_owned())
    }
}

/// The system's message, or a plainer one for the most usual errors.
fn message_of(error: &std::io::Error) -> String {
    match error.kind() {
        ErrorKind::NotFound => "no such file or folder".into(),
        _ => error.to_string(),
    }
}

/// Says how many frames were received before, if any.
fn after(frames: u64) -> String {
    match frames {
        0 => String::new(),
        n => format!(", after {}", count_of(n, "frame")),
    }
}
