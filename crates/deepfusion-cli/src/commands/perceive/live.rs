//! Targets from a camera or a stream.

use deepfusion_hint::count_of;
use deepfusion_jobs::bulk::{DepthJob, record_line};
use deepfusion_jobs::scene::StraightWay;
use deepfusion_jobs::{TargetFinder, live};
use deepfusion_records::FrameRecord;
use deepfusion_video::Address;

use crate::cli::PerceiveArgs;
use crate::commands::live::{open, warn_of_end};
use crate::failure::Result;
use crate::output;
use crate::progress::say;

/// Finds the targets of a live source until it ends.
pub(super) fn run(
    args: &PerceiveArgs,
    job: &DepthJob<'_>,
    finder: TargetFinder<'_>,
    address: &Address,
) -> Result<()> {
    let mut feed = open(address, &job.loader.camera, &args.prediction)?;
    let found = |record: &FrameRecord| -> Result<()> {
        if args.json {
            output::print(&record_line(record)?)?;
        }
        Ok(())
    };
    let way = StraightWay::new(args.speed);
    let seen = live::perceive(job, finder, way, (address, &mut feed), found, say)?;
    warn_of_end(address, &seen.ending);
    if let Some(figures) = feed.summary() {
        let ended = seen.ending.as_ref();
        say(&format!(
            "{}, {} written to {} ({}): {figures}",
            count_of(seen.frames, "frame"),
            count_of(seen.targets, "target"),
            args.prediction.out.display(),
            ended.map_or("the source was lost", |e| e.as_str())
        ));
    }
    seen.ending.map(|_| ())
}
