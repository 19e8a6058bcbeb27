//! Targets of many images, in their order: while the network runs on one, the next is read and the last is written.

use std::sync::{Mutex, MutexGuard, PoisonError};
use std::time::Instant;

use super::DepthJob;
use super::pipeline::{self, Threads};
use crate::outputs::TargetWriter;
use crate::scene::MotionTracker;
use crate::{Error, Input, PerceivedFrame, Result, StartedFrame, TargetFinder};

/// A frame whose targets are written.
#[derive(Debug, Clone, Copy)]
pub struct WrittenTargets<'a> {
    /// Its line in the file of all targets.
    pub line: &'a str,
    /// Frames that are done or could not be read, this one among them.
    pub done: usize,
    /// Frames in all.
    pub total: usize,
}

/// What became of the frames of a run. `E` is what fails.
#[derive(Debug)]
pub struct TargetSummary<E> {
    /// Frames whose targets are written.
    pub done: usize,
    /// Frames in all.
    pub total: usize,
    /// Targets that were found in them.
    pub targets: usize,
    /// Of the frames that could not be read.
    pub unreadable: Vec<E>,
    /// What ended the run before its end.
    pub stopped_by: Option<E>,
    latency_ms: Vec<f64>,
}

impl<E> TargetSummary<E> {
    fn new(total: usize) -> Self {
        Self {
            done: 0,
            total,
            targets: 0,
            unreadable: Vec::new(),
            stopped_by: None,
            latency_ms: Vec::new(),
        }
    }

    /// Milliseconds from opening a file to having its targets; `None` where no frame is done.
    #[must_use]
    pub fn median_latency_ms(&self) -> Option<f64> {
        let mut sorted = self.latency_ms.clone();
        sorted.sort_by(f64::total_cmp);
        sorted.get(sorted.len() / 2).copied()
    }
}

/// Finds the targets of frame after frame and writes them; `written` sees each frame whose files are there. A frame that cannot be read is
/// left out. The run ends where nothing can be found, written or reported any more, and with what is at work where `stop` says so. The file
/// of all targets is then in its place, of the frames that are done.
///
/// # Errors
/// Where the file of all targets cannot be begun, or put in its place.
///
/// # Panics
/// Where a thread of it panics.
pub fn perceive<E, W>(
    job: &DepthJob<'_>,
    mut finder: TargetFinder<'_>,
    inputs: &[Input],
    stop: &(dyn Fn() -> bool + Sync),
    written: W,
) -> Result<TargetSummary<E>>
where
    E: From<Error> + Send,
    W: FnMut(WrittenTargets<'_>) -> Result<(), E> + Send,
{
    let run = TargetRun {
        job,
        inputs,
        writer: TargetWriter::begin(&job.writer)?,
        written: Mutex::new(written),
        summary: Mutex::new(TargetSummary::new(inputs.len())),
    };
    let load = |index: usize| run.load(index);
    let mut motions = MotionTracker::default();
    let find = |started: StartedFrame| -> Result<PerceivedFrame> {
        let motion = motions.next(&started.input);
        let found = finder.next(started, motion)?;
        job.warn_of_drift(&found.input.name, found.drift);
        Ok(found)
    };
    let write = |_: usize, found: Result<PerceivedFrame>| run.finish_frame(found);
    let stop = || stop() || run.summary().stopped_by.is_some();
    // One thread reads and one writes: frames stay in their order.
    let threads = Threads {
        before: 1,
        after: 1,
    };
    pipeline::run(inputs.len(), threads, &stop, &load, find, &write);
    run.finish()
}

/// What the threads of a run share.
struct TargetRun<'a, E, W> {
    job: &'a DepthJob<'a>,
    inputs: &'a [Input],
    writer: TargetWriter<'a>,
    written: Mutex<W>,
    summary: Mutex<TargetSummary<E>>,
}

impl<E, W> TargetRun<'_, E, W>
where
    E: From<Error>,
    W: FnMut(WrittenTargets<'_>) -> Result<(), E>,
{
    fn load(&self, index: usize) -> Option<StartedFrame> {
        let start = Instant::now();
        let input = self.inputs[index].clone();
        match self.job.load(&input) {
            Ok((loaded, prepared)) => Some(StartedFrame {
                input,
                loaded,
                prepared,
                start,
            }),
            Err(error) => {
                self.summary().unreadable.push(error.into());
                None
            }
        }
    }

    fn finish_frame(&self, found: Result<PerceivedFrame>) {
        if let Err(error) = self.write(found) {
            self.summary().stopped_by.get_or_insert(error);
        }
    }

    fn write(&self, found: Result<PerceivedFrame>) -> Result<(), E> {
        let found = found?;
        let line = self.writer.write(&found)?;
        self.report(&line)?;
        let mut summary = self.summary();
        summary.done += 1;
        summary.targets += found.record.targets.len();
        summary.latency_ms.push(found.latency_ms);
        Ok(())
    }

    /// Without the summary's lock: `written` may take its time.
    fn report(&self, line: &str) -> Result<(), E> {
        let summary = self.summary();
        let done = summary.done + 1 + summary.unreadable.len();
        drop(summary);
        let mut written = self.written.lock().unwrap_or_else(PoisonError::into_inner);
        (*written)(WrittenTargets {
            line,
            done,
            total: self.inputs.len(),
        })
    }

    fn summary(&self) -> MutexGuard<'_, TargetSummary<E>> {
        // A thread that panicked ends the program with its own message.
        self.summary.lock().unwrap_or_else(PoisonError::into_inner)
    }

    fn finish(self) -> Result<TargetSummary<E>> {
        let summary = self.summary.into_inner();
        let summary = summary.unwrap_or_else(PoisonError::into_inner);
        self.writer.finish(summary.done)?;
        Ok(summary)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_median_is_that_of_the_frames_that_are_done() {
        let mut summary = TargetSummary::<Error>::new(4);
        assert_eq!(summary.median_latency_ms(), None);
        summary.latency_ms = vec![90.0, 12.0, 31.0];
        assert_eq!(summary.median_latency_ms(), Some(31.0));
    }
}
