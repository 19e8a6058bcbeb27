//! Why a live source cannot be read, or not any more, and why its settings are none.

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

/// Why a live source cannot be read, or not any more, as the end of a sentence about ffmpeg.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum LiveProblem {
    /// A camera is given by number where cameras have names.
    #[error("knows cameras by name here, not by number")]
    CameraNumber,
    /// ffmpeg knows no way to this system's cameras.
    #[error("reads no cameras on this system")]
    NoCameras,
    /// Its frames have changed their size.
    #[error("gave frames of {}x{}, and now of {}x{}", first.0, first.1, now.0, now.1)]
    Size {
        /// Width and height of the first frame.
        first: (u32, u32),
        /// Width and height of this one.
        now: (u32, u32),
    },
    /// What comes is no frame.
    #[error("cannot be read: {0}")]
    Frame(#[source] Arc<LiveFrameProblem>),
    /// ffmpeg ended, and the source should not have.
    #[error("{}: {}{}", happened(*frames), ended(*code), quoted(said))]
    Lost {
        /// What kind of source it is.
        kind: SourceKind,
        /// How many frames had come.
        frames: u64,
        /// ffmpeg's exit code, if it ended by itself.
        code: Option<i32>,
        /// What it said last, without the source's password.
        said: Vec<String>,
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
        None => "was ended".into(),
    }
}

impl LiveProblem {
    pub(crate) fn hint(&self) -> &'static str {
        match self {
            Self::CameraNumber => {
                "`ffmpeg -list_devices true -f dshow -i dummy` lists them: camera:NAME"
            }
            Self::NoCameras => "give a stream's address, or pipe a stream in and give -",
            Self::Size { .. } => "start again: a camera of another size has other intrinsics",
            Self::Frame(_) => "a newer ffmpeg may know the stream better",
            Self::Lost { frames: 1.., .. } => {
                "what was written is whole; start again when the source is back"
            }
            Self::Lost {
                kind: SourceKind::Stdin,
                ..
            } => "pipe a stream that ffmpeg knows: Motion-JPEG, MPEG-TS, YUV4MPEG, Matroska",
            Self::Lost { said, .. } if asks_for_password(said) => {
                "give name and password: rtsp://NAME:PASSWORD@HOST/…"
            }
            Self::Lost {
                kind: SourceKind::Camera,
                ..
            } => {
                "is it plugged in, free, and yours to read? `v4l2-ctl --list-devices` lists the cameras of Linux, \
                 `ffmpeg -sources` those ffmpeg knows"
            }
            Self::Lost { .. } => {
                "is the source running, and the address right? `ffplay ADDRESS` shows what it sends"
            }
        }
    }
}

fn asks_for_password(said: &[String]) -> bool {
    let refused = |line: &String| line.contains("nauthorized") || line.contains("orbidden");
    said.iter().any(refused)
}

/// What it said, to be put behind what happened.
pub(crate) fn quoted(said: &[String]) -> String {
    if said.is_empty() {
        String::new()
    } else {
        format!(", saying\n  {}", said.join("\n  "))
    }
}

/// Why a live source's frame cannot be read.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum LiveFrameProblem {
    /// It does not begin as a picture.
    #[error("a frame that does not begin with P6")]
    Magic,
    /// Its size is that of no picture.
    #[error("a frame's size of {0:?}")]
    Size(String),
    /// What should be its header goes on and on.
    #[error("a frame without a header")]
    Header,
    /// The pipe cannot be read.
    #[error(transparent)]
    Pipe(#[from] io::Error),
}

/// Why it is not understood what a camera is to give.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum CameraModeProblem {
    /// There is no such setting.
    #[error("a camera has no setting `{0}`")]
    Unknown(String),
    /// A setting is given twice.
    #[error("setting `{0}` is given twice")]
    Again(String),
    /// That is no size.
    #[error("setting `size`: expected width and height in pixels, such as 1920x1080, found `{0}`")]
    Size(String),
    /// That is no rate.
    #[error("setting `fps`: expected frames a second, such as 30, at most 1000, found `{0}`")]
    Rate(String),
    /// That is no format's name.
    #[error("setting `format`: expected a format by ffmpeg's name, such as mjpeg, found `{0}`")]
    Format(String),
}
