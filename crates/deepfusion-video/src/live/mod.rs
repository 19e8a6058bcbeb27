//! Cameras and streams as they come: the user's ffmpeg decodes, and only the newest frame is kept.
//!
//! A network that is slower than its source must skip frames, or it would fall behind further and further. So a
//! thread reads every frame into a slot of one: who takes from it gets the newest, and what was never
//! taken is counted. Nothing here grows with time.

mod address;
mod ffmpeg;
mod ppm;
mod slot;

pub use address::Address;
pub use slot::LiveFrame;

use self::ffmpeg::{Ffmpeg, FfmpegExit, quoted};
use self::slot::SlotState;
use crate::{Error, Result};
use deepfusion_hint::count_of;
use std::path::PathBuf;
use std::time::Duration;

/// What [`LiveSource::take`] found.
#[derive(Debug)]
pub enum NextFrame {
    /// The newest frame.
    Frame(LiveFrame),
    /// None came while it waited.
    NotYet,
    /// The stream has ended as streams do; every later call says so again.
    Ended,
}

/// A camera or stream that is being read. Dropping it ends its ffmpeg.
#[derive(Debug)]
pub struct LiveSource {
    address: Address,
    timeout: Duration,
    ffmpeg: Ffmpeg,
    size: Option<(u32, u32)>,
    /// The mode of frames was named as before ffmpeg 5.1.
    old_names: bool,
}

impl LiveSource {
    /// Starts to read; whether anything comes is found by [`Self::take`]. A source that is silent for `timeout` is
    /// taken for lost.
    ///
    /// # Errors
    /// [`Error::Program`] where ffmpeg is not installed, or this system's cameras are named otherwise.
    pub fn open(address: Address, timeout: Duration) -> Result<Self> {
        Ok(Self {
            ffmpeg: Ffmpeg::start(&address, false)?,
            address,
            timeout,
            size: None,
            old_names: false,
        })
    }

    /// Where it reads from.
    #[must_use]
    pub fn address(&self) -> &Address {
        &self.address
    }

    /// The newest frame that was not taken yet, waiting for one no longer than `wait`. The last frame of a stream is
    /// given before its end.
    ///
    /// # Errors
    /// [`Error::Program`] where the connection is refused or lost, nothing comes for the timeout, or the frames change
    /// their size; it says how many frames had come, and what ffmpeg said.
    pub fn take(&mut self, wait: Duration) -> Result<NextFrame> {
        match self.ffmpeg.slot().take(wait) {
            SlotState::Frame(frame) => {
                let size = frame.image.dimensions();
                let first = *self.size.get_or_insert(size);
                if first == size {
                    return Ok(NextFrame::Frame(frame));
                }
                let ((w, h), (width, height)) = (first, size);
                Err(self.error(
                    format!("gave frames of {w}x{h}, and now of {width}x{height}"),
                    "start again: a camera of another size has other intrinsics",
                ))
            }
            SlotState::Nothing { silence } if silence >= self.timeout => Err(self.silent()),
            SlotState::Nothing { .. } => Ok(NextFrame::NotYet),
            SlotState::Closed(problem) => self.ended(problem),
        }
    }

    /// The pipe was closed: by the stream's end, or by what went wrong.
    fn ended(&mut self, problem: Option<String>) -> Result<NextFrame> {
        let end = self.ffmpeg.end();
        let came = self.ffmpeg.slot().arrived();
        if came == 0 && !self.old_names && end.knows_no_option() {
            // The arguments are looked at before anything is opened: the source has not noticed.
            self.old_names = true;
            self.ffmpeg = Ffmpeg::start(&self.address, true)?;
            return Ok(NextFrame::NotYet);
        }
        if let Some(problem) = problem {
            return Err(self.error(problem, "a newer ffmpeg may know the stream better"));
        }
        if came > 0 && end.is_clean() && self.address.may_end() {
            return Ok(NextFrame::Ended);
        }
        let happened = match came {
            0 => "gave no frame".to_owned(),
            n => format!("lost the connection after {}", count_of(n, "frame")),
        };
        Err(self.error(
            format!("{happened}: {}", self.address.without_password(&end.text())),
            remedy(&self.address, came, &end),
        ))
    }

    /// Nothing came for too long.
    fn silent(&self) -> Error {
        let before = match self.ffmpeg.slot().arrived() {
            0 => String::new(),
            n => format!(", after {}", count_of(n, "frame")),
        };
        let said = self.address.without_password(&quoted(&self.ffmpeg.said()));
        let seconds = self.timeout.as_secs_f64();
        Error::Silent {
            address: self.address.to_string(),
            problem: format!("gave no frame for {seconds} s{before}{said}"),
        }
    }

    fn error(&self, problem: String, remedy: &'static str) -> Error {
        Error::Program {
            path: PathBuf::from(self.address.to_string()),
            program: "ffmpeg",
            problem,
            remedy,
        }
    }
}

fn remedy(address: &Address, came: u64, end: &FfmpegExit) -> &'static str {
    if came > 0 {
        return "what was written is whole; start again when the source is back";
    }
    if address.is_stdin() {
        return "pipe a stream that ffmpeg knows: Motion-JPEG, MPEG-TS, YUV4MPEG, Matroska";
    }
    if end.said_one_of(&["nauthorized", "orbidden"]) {
        return "give name and password: rtsp://NAME:PASSWORD@HOST/…";
    }
    if address.is_camera() {
        return "is it plugged in, free, and yours to read? `v4l2-ctl --list-devices` lists the cameras of Linux, \
                `ffmpeg -sources` those ffmpeg knows";
    }
    "is the source running, and the address right? `ffplay ADDRESS` shows what it sends"
}
