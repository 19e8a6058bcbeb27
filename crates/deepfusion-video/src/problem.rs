//! What can be wrong with a program, and with its input.

mod live;
mod packet;

pub(crate) use self::live::quoted;
pub use self::live::{CameraModeProblem, LiveFrameProblem, LiveProblem, SourceKind};
pub use self::packet::PacketProblem;

use deepfusion_hint::{Hint, count_of};
use std::fmt;

/// The task of a program.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[non_exhaustive]
pub enum ProgramTask {
    /// Read a video, or packets of one.
    Read,
    /// Write a video.
    Write,
    /// Read a camera or a stream.
    ReadLive,
}

impl fmt::Display for ProgramTask {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Read => "read videos",
            Self::Write => "write videos",
            Self::ReadLive => "read live sources",
        })
    }
}

/// What happened to ffmpeg or ffprobe, as the end of a sentence that begins with the program's name.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum ProgramProblem {
    /// The program is not installed.
    #[error("is needed to {0} and is not installed")]
    NotInstalled(ProgramTask),
    /// The system does not run the program.
    #[error("cannot be run: {0}")]
    NotRun(#[source] std::io::Error),
    /// The program failed.
    #[error("failed: {message}")]
    Failed {
        /// The task of the program.
        task: ProgramTask,
        /// What it printed.
        message: String,
    },
    /// The program lacks a decoder, or space for its pictures.
    #[error("{message}")]
    Unable {
        /// The line in which it says so.
        message: String,
    },
    /// The program decoded another number of frames than ffprobe counts.
    #[error("decoded {}, ffprobe counts {counted}", count_of(*decoded, "frame"))]
    Frames {
        /// Number of decoded frames.
        decoded: usize,
        /// Number of frames that ffprobe counts.
        counted: usize,
    },
    /// The program stopped early, and reported success.
    #[error("wrote only a part of the video: {message}")]
    StoppedEarly {
        /// What it printed.
        message: String,
    },
    /// The program's answer cannot be used.
    #[error(transparent)]
    Answer(#[from] AnswerProblem),
    /// A live source cannot be read, or no longer.
    #[error(transparent)]
    Live(#[from] LiveProblem),
}

/// Why ffprobe's answer about a video cannot be used.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum AnswerProblem {
    /// The answer cannot be parsed.
    #[error("gave an answer that cannot be read: {0}")]
    Unreadable(#[from] serde_json::Error),
    /// The file has no video stream.
    #[error("finds no video stream")]
    NoStream,
    /// The video stream has no size.
    #[error("does not give the images' size")]
    NoSize,
    /// The video stream has no frame.
    #[error("finds no frame")]
    NoFrame,
}

impl Hint for ProgramProblem {
    fn hint(&self) -> Option<String> {
        use ProgramTask::{Read, ReadLive, Write};
        let text = match self {
            Self::NotInstalled(Read) => {
                "install ffmpeg (it brings ffprobe) so that both are on the PATH, or extract the frames elsewhere \
                 and give their folder"
            }
            Self::NotInstalled(Write) => {
                "install ffmpeg so that it is on the PATH, or save the pictures and make the video on another machine"
            }
            Self::NotInstalled(ReadLive) => {
                "install ffmpeg so that it is on the PATH: it reads cameras and streams"
            }
            Self::NotRun(_) => "check that it runs in a terminal",
            Self::Failed { task: Write, .. } => {
                "check whether the disk is full, or install an ffmpeg with an encoder for MP4"
            }
            Self::Failed { .. } => {
                "play the file to check that it is complete, or install a newer ffmpeg that knows its codec"
            }
            Self::Unable { .. } => {
                "install an ffmpeg that decodes the stream, and check that the disk has space for its pictures"
            }
            Self::Frames { .. } => {
                "part of the video is damaged; encode it again, for example with ffmpeg -i OLD -c:v libx264 -crf 12 NEW.mp4"
            }
            Self::StoppedEarly { .. } => {
                "check whether the disk is full and the pictures can be opened"
            }
            Self::Answer(_) => "check that the file is a video and complete",
            Self::Live(problem) => problem.hint(),
        };
        Some(text.to_owned())
    }
}
