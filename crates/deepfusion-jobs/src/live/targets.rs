//! Targets from a live source.

use std::sync::{Mutex, PoisonError};

use deepfusion_records::{FrameRecord, LiveMark};
use deepfusion_video::{Address, LiveFrame};

use super::{Feed, LiveEnd, input, run};
use crate::bulk::DepthJob;
use crate::outputs::TargetWriter;
use crate::scene::StraightWay;
use crate::{Error, PerceivedFrame, Result, StartedFrame, TargetFinder};

/// The result of targets from a live source. `E` is the error type.
#[derive(Debug)]
pub struct LiveTargets<E> {
    /// Number of frames written.
    pub frames: usize,
    /// Number of targets found in them.
    pub targets: usize,
    /// Why the run ended, or what failed.
    pub ending: Result<LiveEnd, E>,
}

/// Finds the targets of the newest frame of a source again and again, and writes them. `found` is called with each frame's targets before
/// its files are written, so that it need not wait for pictures. Written files stay, even if the source is lost. Otherwise as [`run`].
///
/// # Errors
/// If the file with all targets cannot be created or renamed.
///
/// # Panics
/// If the writing thread panics.
pub fn perceive<E: From<Error> + Send>(
    job: &DepthJob<'_>,
    mut finder: TargetFinder<'_>,
    mut way: StraightWay,
    (address, feed): (&Address, &mut Feed),
    found: impl Fn(&FrameRecord) -> Result<(), E>,
    say: impl Fn(&str),
) -> Result<LiveTargets<E>> {
    let process = |frame: LiveFrame| -> Result<(PerceivedFrame, f64), E> {
        let frame = find_targets(job, &mut finder, &mut way, address, frame)?;
        found(&frame.record)?;
        let latency_ms = frame.latency_ms;
        Ok((frame, latency_ms))
    };
    let writer = TargetWriter::begin(&job.writer)?;
    let counts = Mutex::new((0_usize, 0_usize));
    let write = |frame: PerceivedFrame| -> Result<(), E> {
        writer.write(&frame)?;
        let mut counts = counts.lock().unwrap_or_else(PoisonError::into_inner);
        counts.0 += 1;
        counts.1 += frame.record.targets.len();
        Ok(())
    };
    let ending = run(feed, process, write, say);
    let (frames, targets) = counts.into_inner().unwrap_or_else(PoisonError::into_inner);
    writer.finish(frames)?;
    Ok(LiveTargets {
        frames,
        targets,
        ending,
    })
}

/// Finds the targets in a frame.
fn find_targets(
    job: &DepthJob<'_>,
    finder: &mut TargetFinder<'_>,
    way: &mut StraightWay,
    address: &Address,
    frame: LiveFrame,
) -> Result<PerceivedFrame> {
    let input = input(address, &frame);
    let start = frame.arrived;
    let mark = LiveMark::of_arrival(frame.arrived_at, frame.dropped);
    let (loaded, prepared) = job.load_live(&input, frame)?;
    let started = StartedFrame {
        input,
        loaded,
        prepared,
        start,
    };
    let mut found = finder.next(started, way.at(start))?;
    job.warn_of_drift(&found.input.name, found.drift);
    let latency_ms = found.latency_ms;
    found.loaded.live = Some(LiveMark { latency_ms, ..mark });
    found.record.arrived_unix_s = Some(mark.arrived_unix_s);
    found.record.dropped = Some(mark.dropped);
    Ok(found)
}
