//! Targets of a camera or a stream.

use std::time::Instant;

use deepfusion_geometry::Se3;
use deepfusion_hint::count_of;
use deepfusion_jobs::bulk::record_line;
use deepfusion_jobs::scene::Motion;
use deepfusion_perception::Stamp;
use deepfusion_records::LiveMark;
use deepfusion_video::{Address, LiveFrame};
use nalgebra::Vector3;

use super::Work;
use super::frame_processor::{FrameProcessor, PerceivedFrame, StartedFrame};
use crate::commands::live::{self, Feed};
use crate::failure::Result;
use crate::output;
use crate::progress::say;

impl Work<'_> {
    /// Looks at a live source until it ends.
    pub(super) fn go_live(self, address: &Address, mut processor: FrameProcessor) -> Result<()> {
        let mut way = StraightWay::new(self.args.speed);
        let mut feed = Feed::open(address, &self.args.prediction.live)?;
        let look = |frame: LiveFrame| {
            let input = live::input(address, &frame);
            let (start, mark) = (
                frame.arrived,
                LiveMark::of_arrival(frame.arrived_at, frame.dropped),
            );
            let (loaded, prepared) = self.job.load_live(frame)?;
            let started = StartedFrame {
                input,
                loaded,
                prepared,
                start,
            };
            let motion = way.at(start);
            let mut found = processor.process(started, motion)?;
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
        let ending = live::run(&mut feed, look, |found: PerceivedFrame| self.write(&found));
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

/// The way of a camera that looks straight ahead from a vehicle that drives straight on. The scale is not watched: a speed
/// that is given once for all says nothing of the metres.
struct StraightWay {
    speed_mps: Option<f64>,
    first: Option<Instant>,
}

impl StraightWay {
    /// At one speed in m/s: 0 is a camera that stands. Without it nothing is known of its way.
    fn new(speed_mps: Option<f64>) -> Self {
        Self {
            speed_mps,
            first: None,
        }
    }

    /// Its motion at a frame's arrival.
    fn at(&mut self, arrived: Instant) -> Motion {
        let Some(speed) = self.speed_mps else {
            return Motion::default();
        };
        let goes_on = self.first.is_some();
        let first = *self.first.get_or_insert(arrived);
        let time_s = arrived.duration_since(first).as_secs_f64();
        let place = Vector3::z() * speed * time_s;
        Motion {
            stamp: Some(Stamp {
                time_s,
                world_from_cam: Se3::from_axis_angle(Vector3::zeros(), place),
            }),
            speed_mps: Some(speed),
            goes_on,
            ..Motion::default()
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::time::Duration;

    #[test]
    fn a_given_speed_is_a_way_straight_ahead() {
        let mut way = StraightWay::new(Some(8.0));
        let start = Instant::now();
        assert!(!way.at(start).goes_on);
        let motion = way.at(start + Duration::from_millis(250));
        let stamp = motion.stamp.unwrap();
        assert_eq!(stamp.time_s, 0.25);
        assert_eq!(
            stamp.world_from_cam.translation(),
            Vector3::new(0.0, 0.0, 2.0)
        );
        assert_eq!(motion.speed_mps, Some(8.0));
        assert!(motion.goes_on);
        let mut nowhere = StraightWay::new(None);
        for _ in 0..2 {
            let unknown = nowhere.at(start);
            assert!(unknown.stamp.is_none() && unknown.speed_mps.is_none() && !unknown.goes_on);
        }
    }
}
