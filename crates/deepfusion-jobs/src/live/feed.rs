//! The loop over a live source: take the newest, process it, hand over, until it is enough.

use std::time::{Duration, Instant};

use crossbeam_channel::bounded;
use deepfusion_video::{Address, LiveFrame, LiveSource, NextFrame};

use super::figures::Figures;
use crate::Result;

/// Whether it is to stop is asked this often while nothing comes.
const ASK_EVERY: Duration = Duration::from_millis(100);

/// Why a run over a live source came to its end.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[non_exhaustive]
pub enum LiveEnd {
    /// The stream was over.
    Stream,
    /// The other side closed the connection in good order: whether the stream was over or is lost cannot be seen.
    Closed,
    /// As many frames, or as long, as were asked for.
    Enough,
    /// It was asked to stop.
    Stopped,
}

impl LiveEnd {
    /// In words.
    #[must_use]
    pub fn as_str(self) -> &'static str {
        match self {
            Self::Stream | Self::Closed => "the stream ended",
            Self::Enough => "as many as were asked for",
            Self::Stopped => "stopped",
        }
    }
}

/// The frames of a source until it ends, is lost, or enough of them were seen.
pub struct Feed {
    source: LiveSource,
    frames: u64,
    duration: Option<Duration>,
    stop: fn() -> bool,
    first: Option<Instant>,
    figures: Figures,
}

/// When a live source is left.
#[derive(Debug, Clone, Copy)]
pub struct LiveLimits {
    /// After so many frames; skipped ones do not count.
    pub frames: Option<u64>,
    /// So many seconds after the first frame.
    pub duration_s: Option<f64>,
    /// After so many seconds of silence, which are an error.
    pub timeout_s: f64,
    /// Where this says so.
    pub stop: fn() -> bool,
}

impl Feed {
    /// Begins to read.
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

    /// The whole run's figures; `None` where nothing came.
    #[must_use]
    pub fn summary(&self) -> Option<String> {
        self.figures.summary()
    }

    /// The next frame: the newest there is, or why there is none.
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

/// Any time that can be waited.
fn seconds(s: f64) -> Duration {
    Duration::try_from_secs_f64(s).unwrap_or(Duration::MAX)
}

/// Processes frame after frame, always the newest, and writes what comes of it on a thread of its own. `process` also returns the
/// latency, in milliseconds; `say` gets a line on how it goes, now and then. One result may wait for the writer: beyond that the network
/// waits, the source's frames are skipped, and none is late.
///
/// What was processed is written, also where the source is lost: its error comes after that. Where the other side closed the connection
/// ([`LiveEnd::Closed`]), that may be a loss, too.
///
/// # Errors
/// Those of the source, of `process` and of `write`.
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
                        // The writer has failed, and says why below.
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
