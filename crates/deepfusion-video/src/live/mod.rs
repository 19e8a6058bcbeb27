//! Cameras and streams in real time: the user's ffmpeg decodes, and only the newest frame is kept.
//!
//! A network that is slower than its source must skip frames, or it would fall further and further behind. So a
//! thread reads every frame into a slot of one. Taking from it gives the newest frame; frames that were never
//! taken are counted. Nothing here grows with time.

mod address;
mod camera_mode;
mod ffmpeg;
mod ppm;
mod slot;

pub use address::Address;
pub use slot::LiveFrame;

use self::ffmpeg::Ffmpeg;
use self::slot::SlotState;
use crate::{Error, LiveFrameProblem, LiveProblem, Result};
use std::sync::Arc;
use std::time::Duration;

/// The result of [`LiveSource::take`].
#[derive(Debug)]
pub enum NextFrame {
    /// The newest frame.
    Frame(LiveFrame),
    /// No frame came while it waited.
    NotYet,
    /// The stream has ended normally; every later call returns this again.
    Ended,
}

/// A camera or stream that is being read. Dropping it ends its ffmpeg.
#[derive(Debug)]
pub struct LiveSource {
    address: Address,
    timeout: Duration,
    ffmpeg: Ffmpeg,
    size: Option<(u32, u32)>,
    /// Whether ffmpeg needs the option names from before version 5.1.
    old_names: bool,
}

impl LiveSource {
    /// Starts to read; [`Self::take`] shows whether any frame comes. A source that is silent for `timeout` is
    /// considered lost.
    ///
    /// # Errors
    /// [`Error::Program`] if ffmpeg is not installed, or this system's cameras have other names.
    pub fn open(address: Address, timeout: Duration) -> Result<Self> {
        Ok(Self {
            ffmpeg: Ffmpeg::start(&address, false)?,
            address,
            timeout,
            size: None,
            old_names: false,
        })
    }

    /// The address it reads from.
    #[must_use]
    pub fn address(&self) -> &Address {
        &self.address
    }

    /// The newest frame that was not taken yet, waiting for at most `wait`. The last frame of a stream is
    /// returned before its end.
    ///
    /// # Errors
    /// [`Error::Program`] if the connection is refused or lost, no frame comes within the timeout, or the frames change
    /// their size; it says how many frames had come, and what ffmpeg printed.
    pub fn take(&mut self, wait: Duration) -> Result<NextFrame> {
        match self.ffmpeg.slot().take(wait) {
            SlotState::Frame(frame) => {
                let size = frame.image.dimensions();
                let first = *self.size.get_or_insert(size);
                if first == size {
                    return Ok(NextFrame::Frame(frame));
                }
                Err(self.address.error(LiveProblem::Size { first, now: size }))
            }
            SlotState::Nothing { silence } if silence >= self.timeout => Err(self.silent()),
            SlotState::Nothing { .. } => Ok(NextFrame::NotYet),
            SlotState::Closed(problem) => self.ended(problem),
        }
    }

    /// Called when the pipe was closed, by the stream's end or by an error.
    fn ended(&mut self, problem: Option<Arc<LiveFrameProblem>>) -> Result<NextFrame> {
        let end = self.ffmpeg.end();
        let came = self.ffmpeg.slot().arrived();
        if came == 0 && !self.old_names && end.is_too_old() {
            // ffmpeg checks its arguments before it opens anything, so the source was not opened.
            self.old_names = true;
            self.ffmpeg = Ffmpeg::start(&self.address, true)?;
            return Ok(NextFrame::NotYet);
        }
        if let Some(problem) = problem {
            return Err(self.address.error(LiveProblem::Frame(problem)));
        }
        if came > 0 && end.is_clean() && self.address.may_end() {
            return Ok(NextFrame::Ended);
        }
        Err(self.address.error(LiveProblem::Lost {
            kind: self.address.kind(),
            frames: came,
            code: end.code,
            lines: self.without_password(&end.lines),
        }))
    }

    /// The error for a source that was silent for too long.
    fn silent(&self) -> Error {
        Error::Silent {
            address: self.address.to_string(),
            waited: self.timeout,
            frames: self.ffmpeg.slot().arrived(),
            lines: self.without_password(&self.ffmpeg.last_lines()),
        }
    }

    fn without_password(&self, lines: &[String]) -> Vec<String> {
        lines
            .iter()
            .map(|line| self.address.without_password(line))
            .collect()
    }
}
