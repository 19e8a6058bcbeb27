//! Targets of many images, in order: while the network runs on one, the next is read and the previous one is written.

use std::sync::{Mutex, MutexGuard, PoisonError};
use std::time::Instant;

use super::DepthJob;
use super::pipeline::{self, Threads};
use crate::outputs::TargetWriter;
use crate::scene::MotionTracker;
use crate::{Error, Input, PerceivedFrame, Result, StartedFrame, TargetFinder};

/// A frame whose targets have been written.
#[derive(Debug, Clone, Copy)]
pub struct WrittenTargets<'a> {
    /// Its line in the file with all targets.
    pub line: &'a str,
    /// Number of frames that are done or could not be read, including this one.
    pub done: usize,
    /// Number of all frames.
    pub total: usize,
}

/// The result of a run. `E` is the error type.
#[derive(Debug)]
pub struct TargetSummary<E> {
    /// Number of frames whose targets were written.
    pub done: usize,
    /// Number of all frames.
    pub total: usize,
    /// Number of targets found in them.
    pub targets: usize,
    /// The errors of frames that could not be read.
    pub unreadable: Vec<E>,
    /// The error that ended the run early.
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

    /// Median time from opening a file to its targets, in milliseconds; `None` if no frame is done.
    #[must_use]
    pub fn median_latency_ms(&self) -> Option<f64> {
        let mut sorted = self.latency_ms.clone();
        sorted.sort_by(f64::total_cmp);
        sorted.get(sorted.len() / 2).copied()
    }
}

/// Finds and writes the targets of one frame after another; `written` is called for each frame whose files exist. A frame that cannot be
/// read is left out. The run ends if finding, writing or reporting fails, and when `stop` returns true, after the frames in progress. The
/// file with all targets then gets its final name, with the frames that are done.
///
/// # Errors
/// If the file with all targets cannot be created or renamed.
///
/// # Panics
/// If one of its threads panics.
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
    // One thread reads and one writes, so that frames stay in order.
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

    /// Called without the summary's lock, since `written` may take long.
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
        // If a thread panicked, the program ends with that thread's message.
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
    fn the_median_latency_is_over_finished_frames() {
        let mut summary = TargetSummary::<Error>::new(4);
        assert_eq!(summary.median_latency_ms(), None);
        summary.latency_ms = vec![90.0, 12.0, 31.0];
        assert_eq!(summary.median_latency_ms(), Some(31.0));
    }
}
