//! What both converters write: points, times, the vehicle's motion.

use crate::{Dataset, Error, GtKind, MotionModel, Result};
use deepfusion_fs::InTheWay;
use deepfusion_geometry::Se3;
use std::io::Write as _;
use std::ops::ControlFlow;
use std::path::{Path, PathBuf};

/// A frame's measured depth as points of a scanner at the camera's position (x forward, y left, z up, metres). Each
/// projects back to the pixel it came from. `None` if the frame has no depth.
pub(super) fn points(dataset: &Dataset, frame: usize) -> Result<Option<Vec<[f32; 3]>>> {
    let Some(depth) = dataset.ground_truth(frame, GtKind::Z)? else {
        return Ok(None);
    };
    let k = dataset.intrinsics(frame);
    let scanner_from_cam = Se3::cam_from_body_axes().inverse();
    let mut points = Vec::new();
    for (index, z) in depth.data.iter().enumerate().filter(|(_, z)| **z > 0.0) {
        let (u, v) = (index % depth.width, index / depth.width);
        let in_cam = k.back_project(u as f64, v as f64, f64::from(*z));
        let point = scanner_from_cam.transform(&in_cam);
        points.push([point.x as f32, point.y as f32, point.z as f32]);
    }
    Ok(Some(points))
}

/// Whole seconds by which all times of the recordings must be shifted to be after the beginning of 1970; 0 if they
/// already are. Neither layout can represent earlier times, and in a bag 0 means that no time is set. Such times occur if a clock counts
/// from its own start and a sensor started before it.
pub(super) fn seconds_to_move(datasets: &[Dataset]) -> i64 {
    let earliest = |dataset: &Dataset| {
        let frames = dataset.frames().iter().filter_map(|f| f.time_s);
        let track = dataset
            .track()
            .map(MotionModel::times_s)
            .unwrap_or_default();
        let first_s = frames.chain(track.first().copied()).reduce(f64::min)?;
        Some(at_ns(dataset, first_s, 0))
    };
    let earliest = datasets.iter().filter_map(earliest).min().unwrap_or(1);
    // Rounded down to whole seconds: 0 for 1 ns and later, −1 for 0 ns and the second before it.
    (earliest - 1).min(0).div_euclid(NANOS).abs()
}

/// A time of a recording as nanoseconds since 1970, shifted by whole seconds.
pub(super) fn at_ns(dataset: &Dataset, time_s: f64, moved_s: i64) -> i64 {
    let origin_ns = dataset.origin_ns().unwrap_or_default();
    let ns = origin_ns.saturating_add((time_s * 1e9).round() as i64);
    ns.saturating_add(moved_s.saturating_mul(NANOS))
}

const NANOS: i64 = 1_000_000_000;

/// Result of a conversion.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub struct Converted {
    /// Paths of what was written: the drives' folders, or the bag.
    pub paths: Vec<PathBuf>,
    /// Seconds by which every time was shifted because some were not after the beginning of 1970, which neither layout can
    /// represent; usually 0.
    pub moved_s: i64,
}

/// The line in the file beside a recording that marks it as simulated.
pub(super) const SIMULATED: &str = "simulated = true\n";

/// Refuses an output folder that is not empty; it need not exist.
pub(super) fn require_empty(out: &Path) -> Result<()> {
    let found = deepfusion_fs::in_the_way(out);
    match found.map_err(|e| Error::file(out, e))? {
        None => Ok(()),
        Some(InTheWay::Content) => Err(Error::Exists {
            path: out.to_owned(),
        }),
        Some(InTheWay::Unfinished(unfinished)) => Err(unfinished.into()),
    }
}

/// Stops a conversion if the progress callback requests it and frames are left.
pub(super) fn check_not_stopped(asked: ControlFlow<()>, done: usize, total: usize) -> Result<()> {
    if asked.is_break() && done < total {
        Err(Error::Stopped { done, total })
    } else {
        Ok(())
    }
}

pub(super) fn write_text(path: &Path, text: &str) -> Result<()> {
    let failed = |e| Error::file(path, e);
    deepfusion_fs::write_unsynced(path, failed, |out| {
        out.write_all(text.as_bytes()).map_err(failed)
    })
}

/// Half the time span over which a rate is computed, in seconds.
const RATE_REACH_S: f64 = 0.05;

/// A vehicle's motion at one time.
pub(super) struct Moving {
    /// Forward speed, in m/s.
    pub(super) speed_mps: f64,
    /// Rates of turn about x, y and z, in rad/s.
    pub(super) rates_radps: [f64; 3],
    /// Roll and pitch, in radians; 0 if they were not measured.
    pub(super) tilt_rad: [f64; 2],
}

/// The recorded motion at a time; `None` if there is none.
pub(super) fn moving_at(dataset: &Dataset, time_s: f64) -> Option<Moving> {
    let track = dataset.track()?;
    let speed = track.speed_at(time_s)?;
    let reaches = [
        (RATE_REACH_S, RATE_REACH_S),
        (0.0, RATE_REACH_S),
        (RATE_REACH_S, 0.0),
    ];
    let rates = reaches.iter().find_map(|(before, after)| {
        let motion = track.motion(time_s - before, time_s + after)?;
        let [roll, pitch] = motion.tilt_rad;
        Some([roll, pitch, motion.yaw_rad].map(|angle| angle / (before + after)))
    });
    Some(Moving {
        speed_mps: speed,
        rates_radps: rates.unwrap_or_default(),
        tilt_rad: track.tilt(time_s).unwrap_or_default(),
    })
}
