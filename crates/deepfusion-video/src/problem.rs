//! What can be wrong with a program, and with what it reads.

mod live;
mod packet;

pub(crate) use self::live::quoted;
pub use self::live::{CameraModeProblem, LiveFrameProblem, LiveProblem, SourceKind};
pub use self::packet::PacketProblem;

use deepfusion_hint::{Hint, count_of};
use std::fmt;

/// What a program was to do.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[non_exhaustive]
pub enum ProgramTask {
    /// Read a video, or packets of one.
    Read,
    /// Write one.
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
    /// It is not there.
    #[error("is needed to {0} and is not installed")]
    NotInstalled(ProgramTask),
    /// The system does not run it.
    #[error("cannot be run: {0}")]
    NotRun(#[source] std::io::Error),
    /// It failed.
    #[error("failed: {said}")]
    Failed {
        /// What it was to do.
        task: ProgramTask,
        /// What it said.
        said: String,
    },
    /// It lacks a decoder, or room for its pictures.
    #[error("{said}")]
    Unable {
        /// The line in which it says so.
        said: String,
    },
    /// It found another number of frames than ffprobe.
    #[error("decoded {}, ffprobe counts {counted}", count_of(*decoded, "frame"))]
    Frames {
        /// How many it decoded.
        decoded: usize,
        /// How many ffprobe counts.
        counted: usize,
    },
    /// It stopped early, and calls that a success.
    #[error("made only a part of it: {said}")]
    StoppedEarly {
        /// What it said.
        said: String,
    },
    /// Its answer is of no use.
    #[error(transparent)]
    Answer(#[from] AnswerProblem),
    /// A live source cannot be read, or not any more.
    #[error(transparent)]
    Live(#[from] LiveProblem),
}

/// Why ffprobe's answer about a video is of no use.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum AnswerProblem {
    /// It cannot be read.
    #[error("answered what cannot be read: {0}")]
    Unreadable(#[from] serde_json::Error),
    /// There is no video in the file.
    #[error("finds no video stream in it")]
    NoStream,
    /// It has no size.
    #[error("does not know the images' size")]
    NoSize,
    /// The video has no frame.
    #[error("finds no frame in it")]
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
                "install ffmpeg so that it is on the PATH, or save the pictures and make the video elsewhere"
            }
            Self::NotInstalled(ReadLive) => {
                "install ffmpeg so that it is on the PATH; it opens cameras and streams"
            }
            Self::NotRun(_) => "check that it can be run from a terminal",
            Self::Failed { task: Write, .. } => {
                "see whether the disk is full; a newer ffmpeg may have an encoder for MP4"
            }
            Self::Failed { .. } => {
                "play the file to see whether it is whole; a newer ffmpeg may know its codec"
            }
            Self::Unable { .. } => {
                "an ffmpeg that decodes the stream, and space on the disk where its pictures are kept, are needed"
            }
            Self::Frames { .. } => {
                "part of the video is damaged: write it anew, such as ffmpeg -i OLD -c:v libx264 -crf 12 NEW.mp4"
            }
            Self::StoppedEarly { .. } => {
                "see whether the disk is full and the pictures can be opened"
            }
            Self::Answer(_) => "is it a video, and whole?",
            Self::Live(problem) => problem.hint(),
        };
        Some(text.to_owned())
    }
}
