//! Depth from a live source.

use std::path::{Path, PathBuf};
use std::sync::{Mutex, PoisonError};

use deepfusion_records::{LiveMark, Sidecar};
use deepfusion_runtime::DepthEstimator;
use deepfusion_video::{Address, LiveFrame, shown_for};

use super::{Feed, LiveEnd, VIDEO, input, run};
use crate::bulk::{DepthJob, LoadedImage, write_one_video};
use crate::outputs::{DepthOutput, SeenDepth};
use crate::{Error, Input, Result};

/// The result of depth from a live source. `E` is the error type.
pub struct LiveDepth<E> {
    /// Number of frames written.
    frames: usize,
    /// Their names and times of arrival, in seconds since 1970, if a video is made of them.
    filmed: Vec<(String, Option<f64>)>,
    /// Why the run ended, or what failed.
    pub ending: Result<LiveEnd, E>,
}

/// A frame and its depth.
struct SeenFrame {
    input: Input,
    loaded: LoadedImage,
    seen: SeenDepth,
}

/// Predicts the newest frame of a source again and again, and writes its outputs; `written` is called with each sidecar. `video` says
/// whether [a video](LiveDepth::write_video) will be made: the frames' names are then remembered. Written files stay, even if the source is
/// lost. Otherwise as [`run`].
///
/// # Panics
/// If the writing thread panics.
pub fn predict<E: From<Error> + Send>(
    job: &DepthJob<'_>,
    estimator: &mut DepthEstimator,
    address: &Address,
    feed: &mut Feed,
    video: bool,
    written: impl Fn(&Sidecar) -> Result<(), E> + Sync,
    say: impl Fn(&str),
) -> LiveDepth<E> {
    let process = |frame: LiveFrame| -> Result<(SeenFrame, f64), E> {
        Ok(predict_frame(job, estimator, address, frame)?)
    };
    let done = Mutex::new((0, Vec::new()));
    let write = |frame: SeenFrame| -> Result<(), E> {
        let SeenFrame {
            input,
            loaded,
            seen,
        } = frame;
        let sidecar = job.writer.write(&input, &loaded, &seen)?;
        let arrived = loaded.live.as_ref().map(|mark| mark.arrived_unix_s);
        let mut done = done.lock().unwrap_or_else(PoisonError::into_inner);
        done.0 += 1;
        if video {
            done.1.push((input.name, arrived));
        }
        drop(done);
        written(&sidecar)
    };
    let ending = run(feed, process, write, say);
    let (frames, filmed) = done.into_inner().unwrap_or_else(PoisonError::into_inner);
    LiveDepth {
        frames,
        filmed,
        ending,
    }
}

/// Predicts a frame; also returns the time since its arrival, in milliseconds.
fn predict_frame(
    job: &DepthJob<'_>,
    estimator: &mut DepthEstimator,
    address: &Address,
    frame: LiveFrame,
) -> Result<(SeenFrame, f64)> {
    let input = input(address, &frame);
    let arrived = frame.arrived;
    let mark = LiveMark::of_arrival(frame.arrived_at, frame.dropped);
    let (mut loaded, prepared) = job.load_live(&input, frame)?;
    let seen = job.predict(estimator, &prepared)?;
    let latency_ms = arrived.elapsed().as_secs_f64() * 1e3;
    loaded.live = Some(LiveMark { latency_ms, ..mark });
    let frame = SeenFrame {
        input,
        loaded,
        seen,
    };
    Ok((frame, latency_ms))
}

impl<E> LiveDepth<E> {
    /// Number of frames written.
    #[must_use]
    pub fn frames(&self) -> usize {
        self.frames
    }

    /// Makes a video of the frames beside their depth, each shown until the next one arrived: [`VIDEO`] in the folder of their pictures.
    /// Returns its path and its number of frames; `None` if there are no frames.
    ///
    /// # Errors
    /// ffmpeg's error.
    pub fn write_video(&self, folder: &Path) -> Result<Option<(PathBuf, usize)>> {
        let times: Vec<Option<f64>> = self.filmed.iter().map(|(_, time)| *time).collect();
        let names = self.filmed.iter().map(|(name, _)| name.as_str());
        let pictures = DepthOutput::SideBySide.ending();
        write_one_video(folder, names.zip(shown_for(&times)), pictures, VIDEO)
    }
}
