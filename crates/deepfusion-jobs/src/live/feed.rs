//! The loop over a live source: take the newest frame, process it, pass it on, until the end.

use std::time::{Duration, Instant};

use crossbeam_channel::bounded;
use deepfusion_video::{Address, LiveFrame, LiveSource, NextFrame};

use super::figures::Figures;
use crate::Result;

/// How often `stop` is called while no frame arrives.
const ASK_EVERY: Duration = Duration::from_millis(100);

/// Why a run over a live source ended.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[non_exhaustive]
pub enum LiveEnd {
    /// The stream has ended.
    Stream,
    /// The other side closed the connection properly: the stream has ended, or it was lost.
    Closed,
    /// The limit of frames or time was reached.
    Enough,
    /// `stop` returned true.
    Stopped,
}

impl LiveEnd {
    /// The reason as text.
    #[must_use]
    pub fn as_str(self) -> &'static str {
        match self {
            Self::Stream | Self::Closed => "the stream ended",
            Self::Enough => "limit reached",
            Self::Stopped => "stopped",
        }
    }
}

/// The frames of a source, until it ends, is lost, or a limit is reached.
pub struct Feed {
    source: LiveSource,
    frames: u64,
    duration: Option<Duration>,
    stop: fn() -> bool,
    first: Option<Instant>,
    figures: Figures,
}

/// When to stop reading a live source.
#[derive(Debug, Clone, Copy)]
pub struct LiveLimits {
    /// After this many frames; skipped ones do not count.
    pub frames: Option<u64>,
    /// This many seconds after the first frame.
    pub duration_s: Option<f64>,
    /// After this many seconds without a frame, which is an error.
    pub timeout_s: f64,
    /// When this returns true.
    pub stop: fn() -> bool,
}

impl Feed {
    /// Opens the source.
    ///
    /// # Errors
    /// A source that cannot be opened.
    pub fn open(address: &Address, until: &LiveLimits) -> Result<Self> {
        Ok(Self {
            source: LiveSource::open(address.clone(), seconds(until.timeout_s))?,
            frames: until.frames.unwrap_or(u64::MAX),
            duration: until.duration_s.map(seconds),
            stop: until.stop,
            first: None,
            figures: Figures::new(),
        })
    }

    /// Figures of the whole run; `None` if no frame arrived.
    #[must_use]
    pub fn summary(&self) -> Option<String> {
        self.figures.summary()
    }

    /// The newest frame, or why there is none.
    fn next(&mut self) -> Result<Result<LiveFrame, LiveEnd>> {
        loop {
            let late = |first: Instant| self.duration.is_some_and(|d| first.elapsed() >= d);
            if (self.stop)() {
                return Ok(Err(LiveEnd::Stopped));
            }
            if self.frames == 0 || self.first.is_some_and(late) {
                return Ok(Err(LiveEnd::Enough));
            }
            match self.source.take(ASK_EVERY)? {
                NextFrame::Frame(frame) => {
                    self.frames -= 1;
                    self.first.get_or_insert(frame.arrived);
                    return Ok(Ok(frame));
                }
                NextFrame::NotYet => {}
                NextFrame::Ended => {
                    return Ok(Err(if self.source.address().is_stdin() {
                        LiveEnd::Stream
                    } else {
                        LiveEnd::Closed
                    }));
                }
            }
        }
    }
}

/// A duration; any that is too long or invalid becomes the longest possible.
fn seconds(s: f64) -> Duration {
    Duration::try_from_secs_f64(s).unwrap_or(Duration::MAX)
}

/// Processes one frame after another, always the newest, and writes results on another thread. `process` also returns the latency in
/// milliseconds; `say` receives a status line from time to time. One result may wait for the writer. If another one follows, the network
/// waits and the source's frames are skipped, so that results are never old.
///
/// Processed frames are written even if the source is lost; its error is returned afterwards. If the other side closed the connection
/// ([`LiveEnd::Closed`]), the source may also have been lost.
///
/// # Errors
/// Errors of the source, of `process` and of `write`.
pub fn run<O: Send, E: From<crate::Error> + Send>(
    feed: &mut Feed,
    mut process: impl FnMut(LiveFrame) -> Result<(O, f64), E>,
    write: impl Fn(O) -> Result<(), E> + Sync,
    say: impl Fn(&str),
) -> Result<LiveEnd, E> {
    std::thread::scope(|scope| {
        let (to_writer, results) = bounded(1);
        let write = &write;
        let writer = scope.spawn(move || results.into_iter().try_for_each(write));
        let outcome = loop {
            let frame = match feed.next() {
                Ok(Ok(frame)) => frame,
                Ok(Err(ending)) => break Ok(ending),
                Err(lost) => break Err(lost.into()),
            };
            let dropped = frame.dropped;
            match process(frame) {
                Ok((result, latency_ms)) => {
                    if let Some(line) = feed.figures.add(latency_ms, dropped) {
                        say(&line);
                    }
                    if to_writer.send(result).is_err() {
                        // The writer has failed; its error is returned below.
                        break Ok(LiveEnd::Stopped);
                    }
                }
                Err(error) => break Err(error),
            }
        };
        drop(to_writer);
        match writer.join() {
            Ok(written) => written.and(outcome),
            Err(panic) => std::panic::resume_unwind(panic),
        }
    })
}
