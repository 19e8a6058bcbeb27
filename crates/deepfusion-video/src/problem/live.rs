//! Why a live source cannot be read, or no longer, and what is wrong with its settings.

use deepfusion_hint::count_of;
use std::io;
use std::sync::Arc;

/// The kind of a live source.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[non_exhaustive]
pub enum SourceKind {
    /// A camera of this machine.
    Camera,
    /// The address of a stream.
    Stream,
    /// Standard input.
    Stdin,
}

/// Why a live source cannot be read, or no longer, as the end of a sentence that begins with ffmpeg.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum LiveProblem {
    /// A camera is given by number on a system that uses names.
    #[error("knows cameras by name here, not by number")]
    CameraNumber,
    /// ffmpeg cannot read cameras on this system.
    #[error("does not read cameras on this system")]
    NoCameras,
    /// The frames have changed their size.
    #[error("gave frames of {}x{}, and now gives {}x{}", first.0, first.1, now.0, now.1)]
    Size {
        /// Width and height of the first frame.
        first: (u32, u32),
        /// Width and height of this one.
        now: (u32, u32),
    },
    /// The data is not a frame.
    #[error("gave output that cannot be read: {0}")]
    Frame(#[source] Arc<LiveFrameProblem>),
    /// ffmpeg ended, although the source should not have.
    #[error("{}: {}{}", happened(*frames), ended(*code), quoted(lines))]
    Lost {
        /// Kind of the source.
        kind: SourceKind,
        /// Number of frames received.
        frames: u64,
        /// ffmpeg's exit code, if it ended by itself.
        code: Option<i32>,
        /// Its last messages, without the source's password.
        lines: Vec<String>,
    },
}

fn happened(frames: u64) -> String {
    match frames {
        0 => "gave no frame".to_owned(),
        n => format!("lost the connection after {}", count_of(n, "frame")),
    }
}

fn ended(code: Option<i32>) -> String {
    match code {
        Some(code) => format!("ended with code {code}"),
        None => "was killed".into(),
    }
}

impl LiveProblem {
    pub(crate) fn hint(&self) -> &'static str {
        match self {
            Self::CameraNumber => {
                "give camera:NAME; `ffmpeg -list_devices true -f dshow -i dummy` lists the names"
            }
            Self::NoCameras => "give a stream's address, or - for a stream on standard input",
            Self::Size { .. } => "start again: images of another size have other intrinsics",
            Self::Frame(_) => "use a newer ffmpeg, which may know the stream better",
            Self::Lost { frames: 1.., .. } => {
                "start again when the source is back; what was written is complete"
            }
            Self::Lost {
                kind: SourceKind::Stdin,
                ..
            } => "pipe a format that ffmpeg knows: Motion-JPEG, MPEG-TS, YUV4MPEG, Matroska",
            Self::Lost { lines, .. } if asks_for_password(lines) => {
                "give name and password: rtsp://NAME:PASSWORD@HOST/…"
            }
            Self::Lost {
                kind: SourceKind::Camera,
                ..
            } => {
                "check that it is plugged in, not in use, and that you may read it; `v4l2-ctl --list-devices` lists the cameras \
                 on Linux, `ffmpeg -sources` those that ffmpeg finds"
            }
            Self::Lost { .. } => {
                "check that the source is running and the address is right; `ffplay ADDRESS` shows what it sends"
            }
        }
    }
}

fn asks_for_password(lines: &[String]) -> bool {
    let refused = |line: &String| line.contains("nauthorized") || line.contains("orbidden");
    lines.iter().any(refused)
}

/// ffmpeg's messages, to follow what happened.
pub(crate) fn quoted(lines: &[String]) -> String {
    if lines.is_empty() {
        String::new()
    } else {
        format!(", saying\n  {}", lines.join("\n  "))
    }
}

/// Why a live source's frame cannot be read.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum LiveFrameProblem {
    /// The frame does not begin as a picture.
    #[error("the frame does not begin with P6")]
    Magic,
    /// The size of the frame is invalid.
    #[error("invalid frame size {0:?}")]
    Size(String),
    /// The header of the frame does not end.
    #[error("the frame has no header")]
    Header,
    /// The pipe cannot be read.
    #[error(transparent)]
    Pipe(#[from] io::Error),
}

/// What is wrong with the settings of a camera.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum CameraModeProblem {
    /// The setting does not exist.
    #[error("unknown setting `{0}`")]
    Unknown(String),
    /// A setting is given twice.
    #[error("setting `{0}` is given twice")]
    Again(String),
    /// The size is invalid.
    #[error("setting `size`: expected width and height in pixels, such as 1920x1080, found `{0}`")]
    Size(String),
    /// The rate is invalid.
    #[error("setting `fps`: expected frames a second, such as 30, at most 1000, found `{0}`")]
    Rate(String),
    /// The format is not a name.
    #[error("setting `format`: expected a format by ffmpeg's name, such as mjpeg, found `{0}`")]
    Format(String),
}
