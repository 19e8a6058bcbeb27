//! The loop over a live source: take the newest, look, hand over, until it is enough.

use std::time::{Duration, Instant};

use crossbeam_channel::bounded;
use deepfusion_video::{Address, LiveFrame, LiveSource, NextFrame};

use super::figures::Figures;
use crate::cli::LiveArgs;
use crate::failure::Result;
use crate::interrupt;

/// Ctrl-C is looked at this often while nothing comes.
const LOOK_UP: Duration = Duration::from_millis(100);

/// Why a run over a live source came to its end.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Ending {
    /// The stream was over.
    Stream,
    /// `--frames` or `--duration`.
    Enough,
    /// Ctrl-C.
    Stopped,
}

impl Ending {
    /// In words.
    pub(crate) fn as_str(self) -> &'static str {
        match self {
            Self::Stream => "the stream ended",
            Self::Enough => "as many as were asked for",
            Self::Stopped => "stopped",
        }
    }
}

/// The frames of a source until it ends, is lost, or enough of them were seen.
pub(crate) struct Feed {
    source: LiveSource,
    frames: u64,
    duration: Option<Duration>,
    first: Option<Instant>,
    figures: Figures,
}

impl Feed {
    /// Begins to read.
    pub(crate) fn open(address: &Address, args: &LiveArgs) -> Result<Self> {
        let timeout = seconds(args.timeout_s());
        Ok(Self {
            source: LiveSource::open(address.clone(), timeout)?,
            frames: args.frames.unwrap_or(u64::MAX),
            duration: args.duration.map(seconds),
            first: None,
            figures: Figures::new(),
        })
    }

    /// A connection that was closed in good order is an end, and may be a loss.
    fn warn_of_end(&self) {
        let address = self.source.address();
        if !address.is_stdin() {
            tracing::warn!(
                "{address}: the other side closed the stream: whether it was over or is lost cannot be seen"
            );
        }
    }

    /// The whole run's figures; `None` where nothing came.
    pub(crate) fn summary(&self) -> Option<String> {
        self.figures.summary()
    }

    /// The next frame: the newest there is, or why there is none.
    fn next(&mut self) -> Result<Result<LiveFrame, Ending>> {
        loop {
            let late = |first: Instant| self.duration.is_some_and(|d| first.elapsed() >= d);
            if interrupt::asked() {
                return Ok(Err(Ending::Stopped));
            }
            if self.frames == 0 || self.first.is_some_and(late) {
                return Ok(Err(Ending::Enough));
            }
            match self.source.take(LOOK_UP)? {
                NextFrame::Frame(frame) => {
                    self.frames -= 1;
                    self.first.get_or_insert(frame.arrived);
                    return Ok(Ok(frame));
                }
                NextFrame::NotYet => {}
                NextFrame::Ended => {
                    self.warn_of_end();
                    return Ok(Err(Ending::Stream));
                }
            }
        }
    }
}

/// Any time that can be waited.
fn seconds(s: f64) -> Duration {
    Duration::try_from_secs_f64(s).unwrap_or(Duration::MAX)
}

/// Looks at frame after frame, always the newest, and writes what comes of it on a thread of its own. `look` also returns the
/// latency, in milliseconds. One result may wait for the writer: beyond that the network waits, the source's frames are
/// skipped, and none is late.
///
/// What was looked at is written, also where the source is lost: its error comes after that.
pub(crate) fn run<O: Send>(
    feed: &mut Feed,
    mut look: impl FnMut(LiveFrame) -> Result<(O, f64)>,
    write: impl Fn(O) -> Result<()> + Sync,
) -> Result<Ending> {
    std::thread::scope(|scope| {
        let (to_writer, results) = bounded(1);
        let write = &write;
        let writer = scope.spawn(move || results.into_iter().try_for_each(write));
        let looked = loop {
            let frame = match feed.next() {
                Ok(Ok(frame)) => frame,
                Ok(Err(ending)) => break Ok(ending),
                Err(lost) => break Err(lost),
            };
            let dropped = frame.dropped;
            match look(frame) {
                Ok((result, latency_ms)) => {
                    feed.figures.add(latency_ms, dropped);
                    if to_writer.send(result).is_err() {
                        // The writer has failed, and says why below.
                        break Ok(Ending::Stopped);
                    }
                }
                Err(error) => break Err(error),
            }
        };
        drop(to_writer);
        match writer.join() {
            Ok(written) => written.and(looked),
            Err(panic) => std::panic::resume_unwind(panic),
        }
    })
}
