//! Targets of a camera or a stream.

use deepfusion_hint::count_of;
use deepfusion_jobs::bulk::record_line;
use deepfusion_jobs::live;
use deepfusion_jobs::scene::StraightWay;
use deepfusion_jobs::{PerceivedFrame, StartedFrame, TargetFinder};
use deepfusion_records::LiveMark;
use deepfusion_video::{Address, LiveFrame};

use super::{Work, found};
use crate::commands::live::open;
use crate::failure::Result;
use crate::output;
use crate::progress::say;

impl Work<'_> {
    /// Looks at a live source until it ends.
    pub(super) fn go_live(self, address: &Address, mut finder: TargetFinder) -> Result<()> {
        let mut way = StraightWay::new(self.args.speed);
        let mut feed = open(address, &self.args.prediction.live)?;
        let look = |frame: LiveFrame| {
            let input = live::input(address, &frame);
            let (start, mark) = (
                frame.arrived,
                LiveMark::of_arrival(frame.arrived_at, frame.dropped),
            );
            let (loaded, prepared) = self.job.load_live(&input, frame)?;
            let started = StartedFrame {
                input,
                loaded,
                prepared,
                start,
            };
            let motion = way.at(start);
            let mut found = found(finder.next(started, motion))?;
            let latency_ms = found.latency_ms;
            found.loaded.live = Some(LiveMark { latency_ms, ..mark });
            found.record.arrived_unix_s = Some(mark.arrived_unix_s);
            found.record.dropped = Some(mark.dropped);
            if self.args.json {
                // Before its pictures are written: who acts on it need not wait for them.
                output::print(&record_line(&found.record)?)?;
            }
            Ok((found, latency_ms))
        };
        let write = |found: PerceivedFrame| self.write(&found);
        let ending = live::run(&mut feed, look, write, say);
        // What is there stays, also where the source was lost.
        let outcome = self.outcome.into_inner().unwrap_or_else(|e| e.into_inner());
        let lines = self.lines.into_inner().unwrap_or_else(|e| e.into_inner());
        match outcome.done {
            0 => lines.discard(),
            _ => lines.finish()?,
        }
        if let Some(figures) = feed.summary() {
            let ended = ending
                .as_ref()
                .map_or("the source was lost", |e| e.as_str());
            say(&format!(
                "{}, {} written to {} ({ended}): {figures}",
                count_of(outcome.done, "frame"),
                count_of(outcome.targets, "target"),
                self.args.prediction.out.display()
            ));
        }
        ending.map(|_| ())
    }
}
