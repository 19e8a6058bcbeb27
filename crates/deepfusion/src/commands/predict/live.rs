//! Depth of a camera or a stream.

use anyhow::Result;
use deepfusion_data::{Address, LiveFrame};

use super::camera::CameraSource;
use super::manifest::Lock;
use super::{Job, tell_assumed};
use crate::cli::{PredictArgs, Shard};
use crate::commands::live::{self, Feed, LiveMark};
use crate::commands::scene::ScaleWatch;
use crate::error::CliError;
use crate::progress::say;
use crate::{engine, interrupt, output};

/// `deepfusion predict` of a live source: no manifest, for there is nothing to go on with.
pub fn run(args: &PredictArgs, address: &Address) -> Result<()> {
    let (prediction, out) = (&args.prediction, &args.prediction.out);
    if args.shard != Shard::WHOLE {
        return Err(CliError::LiveShard.into());
    }
    ScaleWatch::check(prediction, Some(address), &[])?;
    let predictor = engine::load(&prediction.model, &prediction.engine)?;
    let job = Job::new(prediction, args.outputs(), &predictor)?;
    if args.save.iter().any(|save| save.is_cloud()) && matches!(job.camera, CameraSource::Unknown) {
        return Err(CliError::NoCamera.into());
    }
    live::make_room(out, prediction.overwrite)?;
    let _lock = Lock::take(out, args.shard)?;
    interrupt::catch("stopping after the frames at work");
    if job.camera.word() == "assumed" {
        tell_assumed();
    }
    let mut feed = Feed::open(address, &prediction.live)?;
    let look = |frame: LiveFrame| {
        let input = live::input(address, &frame);
        let (arrived, mark) = (frame.arrived, LiveMark::of(&frame));
        let (mut loaded, prepared) = job.load_live(frame)?;
        let seen = job.see(&predictor, &prepared)?;
        let latency_ms = arrived.elapsed().as_secs_f64() * 1e3;
        loaded.live = Some(LiveMark { latency_ms, ..mark });
        Ok(((input, loaded, seen), latency_ms))
    };
    let done = std::sync::atomic::AtomicUsize::new(0);
    let ending = live::run(&mut feed, look, |(input, loaded, seen)| {
        let sidecar = job.write(&input, &loaded, &seen)?;
        done.fetch_add(1, std::sync::atomic::Ordering::Relaxed);
        match args.json {
            true => output::print(&(serde_json::to_string(&sidecar)? + "\n")),
            false => Ok(()),
        }
    });
    if let Some(figures) = feed.told() {
        let ended = ending.as_ref().map_or("the source was lost", |e| e.told());
        say(&format!(
            "{} images written to {} ({ended}): {figures}",
            done.into_inner(),
            out.display()
        ));
    }
    ending.map(|_| ())
}
