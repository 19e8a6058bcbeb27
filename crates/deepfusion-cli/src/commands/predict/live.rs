//! Depth of a camera or a stream.

use std::sync::{Mutex, PoisonError};

use deepfusion_hint::count_of;
use deepfusion_jobs::bulk::{CameraSource, LoadedImage, Lock, write_one_video};
use deepfusion_jobs::outputs::{DepthOutput, SeenDepth};
use deepfusion_jobs::{Error, Input, live};
use deepfusion_records::LiveMark;
use deepfusion_runtime::ModelSource;
use deepfusion_video::{Address, LiveFrame, shown_for};

use super::{Job, check_watched, print_videos};
use crate::cli::{PredictArgs, Shard};
use crate::commands::live::open;
use crate::error::CliError;
use crate::failure::Result;
use crate::progress::say;
use crate::{engine, interrupt, output};

/// `deepfusion predict` of a live source: no manifest, for there is nothing to go on with.
pub(super) fn run(args: &PredictArgs, model: &ModelSource, address: &Address) -> Result<()> {
    let (prediction, out) = (&args.prediction, &args.prediction.out);
    if args.shard != Shard::WHOLE {
        return Err(CliError::LiveShard.into());
    }
    check_watched(prediction, Some(address), &[])?;
    let mut estimator = engine::load(model, &prediction.engine)?;
    // They are nowhere else, and depth is little without them.
    let mut outputs = args.outputs();
    outputs.frames = true;
    let job = Job::new(prediction, outputs, model, &estimator)?;
    if args.cloud() && matches!(job.loader.camera, CameraSource::Unknown) {
        return Err(Error::NoCamera.into());
    }
    live::make_room(out, prediction.overwrite)?;
    let _lock = Lock::take(out, args.shard)?;
    interrupt::catch("stopping after the frames at work");
    let mut feed = open(address, &prediction.live)?;
    let look = |frame: LiveFrame| {
        let input = live::input(address, &frame);
        let (arrived, mark) = (
            frame.arrived,
            LiveMark::of_arrival(frame.arrived_at, frame.dropped),
        );
        let (mut loaded, prepared) = job.load_live(&input, frame)?;
        let seen = job.see(&mut estimator, &prepared)?;
        let latency_ms = arrived.elapsed().as_secs_f64() * 1e3;
        loaded.live = Some(LiveMark { latency_ms, ..mark });
        Ok(((input, loaded, seen), latency_ms))
    };
    // Name and time of each frame that was written.
    let done = Mutex::new(Vec::new());
    let write = |(input, loaded, seen): (Input, LoadedImage, SeenDepth)| -> Result<()> {
        let sidecar = job.writer.write(&input, &loaded, &seen)?;
        let mark = loaded.live.as_ref().map(|mark| mark.arrived_unix_s);
        let mut done = done.lock().unwrap_or_else(PoisonError::into_inner);
        done.push((input.name, mark));
        drop(done);
        if args.json {
            output::print(&(serde_json::to_string(&sidecar)? + "\n"))
        } else {
            Ok(())
        }
    };
    let ending = live::run(&mut feed, look, write, say);
    let done = done.into_inner().unwrap_or_else(PoisonError::into_inner);
    if let Some(figures) = feed.summary() {
        let ended = ending
            .as_ref()
            .map_or("the source was lost", |e| e.as_str());
        say(&format!(
            "{} written to {} ({ended}): {figures}",
            count_of(done.len(), "image"),
            out.display()
        ));
    }
    let mut filmed = Ok(());
    if args.video() {
        let times: Vec<Option<f64>> = done.iter().map(|(_, time)| *time).collect();
        let shown = done.iter().map(|(name, _)| name.as_str());
        let pictures = DepthOutput::SideBySide.ending();
        filmed = write_one_video(out, shown.zip(shown_for(&times)), pictures, live::VIDEO)
            .map(|video| print_videos(video.as_slice()))
            .map_err(Into::into);
    }
    // Why the source ended comes first: a full disk ends the video, too.
    ending.and(filmed)
}
