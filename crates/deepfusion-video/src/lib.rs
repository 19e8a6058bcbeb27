//! Videos, cameras and streams, all through the user's installed ffmpeg.
//!
//! [`VideoFrames`] gives a file's frames in any order, [`PacketFrames`] those of a stream in messages, [`write_video`] writes pictures as
//! a video, and [`LiveSource`] gives the newest frame of a camera or stream. Without ffmpeg each returns an error with a hint; nothing
//! is linked.

mod cache;
mod decoded;
mod endings;
mod error;
mod frames;
mod live;
mod packets;
mod probe;
mod problem;
mod program;
mod write;

pub use cache::{frames_folder, holds_frames_of};
pub use endings::{VIDEO_ENDINGS, is_video};
pub use error::{Error, Result};
pub use frames::VideoFrames;
pub use live::{Address, LiveFrame, LiveSource, NextFrame};
pub use packets::{Codec, PacketFrames, PacketStream};
pub use problem::{
    AnswerProblem, CameraModeProblem, LiveFrameProblem, LiveProblem, PacketProblem, ProgramProblem,
    ProgramTask, SourceKind,
};
pub use write::{VideoPicture, can_write_video, shown_for, write_video};
