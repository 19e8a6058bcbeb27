//! Depth from a camera or a stream.

use deepfusion_hint::count_of;
use deepfusion_jobs::bulk::{CameraSource, Lock};
use deepfusion_jobs::{Error, live};
use deepfusion_records::Sidecar;
use deepfusion_runtime::ModelSource;
use deepfusion_video::Address;

use super::{check_topics, check_watched, job, print_videos};
use crate::cli::{PredictArgs, Shard};
use crate::commands::live::{open, warn_of_end};
use crate::error::CliError;
use crate::failure::Result;
use crate::progress::say;
use crate::{engine, interrupt, output};

/// `deepfusion predict` of a live source. It writes no manifest, since it cannot be continued.
pub(super) fn run(args: &PredictArgs, model: &ModelSource, address: &Address) -> Result<()> {
    let (prediction, out) = (&args.prediction, &args.prediction.out);
    if args.shard != Shard::WHOLE {
        return Err(CliError::LiveShard.into());
    }
    check_topics(prediction, &[])?;
    check_watched(prediction, Some(address), &[])?;
    let mut estimator = engine::load(model, &prediction.engine)?;
    // The images exist nowhere else, and depth is of little use without them.
    let mut outputs = args.outputs();
    outputs.frames = true;
    let job = job(prediction, outputs, model, &estimator)?;
    if args.cloud() && matches!(job.loader.camera, CameraSource::Unknown) {
        return Err(Error::NoCamera.into());
    }
    output::make_folder(out)?;
    // Before old frames are removed: another run may be writing them.
    let _lock = Lock::take_whole(out)?;
    live::make_room(out, prediction.overwrite)?;
    interrupt::catch("stopping after the current frames");
    let mut feed = open(address, &job.loader.camera, prediction)?;
    let written = |sidecar: &Sidecar| -> Result<()> {
        if args.json {
            output::print(&(serde_json::to_string(sidecar)? + "\n"))
        } else {
            Ok(())
        }
    };
    let seen = live::predict(
        &job,
        &mut estimator,
        address,
        &mut feed,
        args.video(),
        written,
        say,
    );
    warn_of_end(address, &seen.ending);
    if let Some(figures) = feed.summary() {
        let ended = seen.ending.as_ref();
        say(&format!(
            "{} written to {} ({}): {figures}",
            count_of(seen.frames(), "image"),
            out.display(),
            ended.map_or("the source was lost", |e| e.as_str())
        ));
    }
    let mut video_written = Ok(());
    if args.video() {
        video_written = seen
            .write_video(out)
            .map(|video| print_videos(video.as_slice()))
            .map_err(Into::into);
    }
    // The reason why the source ended comes first: a full disk also ends the video.
    seen.ending.and(video_written)
}
