//! The few numbers of a frame that the time line shows, from its small files.

use std::path::Path;

use deepfusion_records::{FrameRecord, ScaleRecord, ScaleState};

use super::entry::Entry;
use super::problem::FrameProblem;
use super::small_files::SmallFiles;

/// What the time line shows of a frame. Absent numbers are `None`.
#[derive(Debug, Clone, Default, PartialEq)]
pub(crate) struct Summary {
    /// Whether this is a frame at all: the folder may contain other JSON files.
    pub is_frame: bool,
    pub has_depth: bool,
    pub has_sigma: bool,
    /// The problem with a small file, if any.
    pub problem: Option<String>,
    pub time_s: Option<f64>,
    pub depth_m: Option<[f64; 2]>,
    pub targets: Option<usize>,
    pub nearest_m: Option<f64>,
    pub speed_mps: Option<f64>,
    pub time_to_collision_s: Option<f64>,
    pub scale_ratio: Option<f64>,
    pub scale_state: Option<ScaleState>,
    pub latency_ms: Option<f64>,
}

impl Summary {
    /// Reads the frame's sidecar and targets. Failures go to [`Summary::problem`].
    pub(crate) fn read(folder: &Path, entry: &Entry) -> Self {
        let files = SmallFiles::read(folder, entry);
        let mut summary = Self {
            // A sidecar that is still being written counts as a frame.
            is_frame: entry.may_have_depth() || entry.targets.is_some() || files.unfinished,
            has_depth: files.depth(entry).is_some(),
            has_sigma: files.sigma(entry).is_some(),
            ..Self::default()
        };
        if let Some(sidecar) = &files.sidecar {
            let record = &sidecar.record;
            summary.is_frame |= record.image.is_some() && record.size.is_some();
            summary.depth_m = record.depth_m.map(|d| d.map(as_written));
            summary.add_scale(record.scale_monitor);
        }
        if let Some(frame) = &files.targets {
            summary.add_targets(&frame.record);
        }
        let problems: Vec<String> = files.problems.iter().map(FrameProblem::to_string).collect();
        summary.problem = (!problems.is_empty()).then(|| problems.join("; "));
        summary
    }

    fn add_targets(&mut self, frame: &FrameRecord) {
        self.time_s = frame.time_s;
        self.speed_mps = frame.speed_mps;
        self.time_to_collision_s = frame.time_to_collision_s;
        self.latency_ms = frame.latency_ms;
        self.targets = Some(frame.targets.len());
        let distances = frame.targets.iter().map(|t| t.distance_m);
        self.nearest_m = distances.min_by(f64::total_cmp);
        self.add_scale(frame.scale_monitor);
    }

    /// Adds the scale monitor's reading.
    fn add_scale(&mut self, monitor: Option<ScaleRecord>) {
        if let Some(monitor) = monitor {
            self.scale_ratio = monitor.reading.ratio;
            self.scale_state = Some(monitor.reading.state);
        }
    }
}

/// A number as written in its file: 5.9, and not 5.900000095, the value of the nearest f32.
fn as_written(number: f32) -> f64 {
    number.to_string().parse().unwrap_or(f64::from(number))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_stay_as_they_are_written() {
        assert_eq!([5.9_f32, 21.0, 0.1].map(as_written), [5.9, 21.0, 0.1]);
    }
}
