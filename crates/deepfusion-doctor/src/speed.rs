//! The speeds compared with the road in the images, with the recording's own poses, and with what a road vehicle can drive.

use super::finding::{Figure, Limit, Outcome, Severity};
use super::reason::{MOST_MPS, MotionReason};
use super::shared_error::SharedError;
use super::skip::MotionSkip;
use super::turning::turning_as_seen;
use deepfusion_data::{
    CameraPath, Dataset, DatasetKind, Frame, PLAUSIBLE_HEIGHT_M, SpeedWarning, road_camera_height,
};
use deepfusion_geometry::Se3;

/// Distance according to the poses over distance according to the speeds.
const RATIO: Limit = Limit::Within(0.95, 1.05);
/// Shorter distances prove nothing, metres.
const LEAST_WAY_M: f64 = 5.0;
/// Distance from one pose that is compared to the next, metres.
const STRETCH_M: f64 = 5.0;

pub(super) fn check(dataset: &Dataset) -> Outcome {
    let mut outcome = Outcome::new("speed");
    // Without turns it is unknown how the road should move.
    let turning = turning_as_seen(dataset);
    by_road(turning.as_ref().unwrap_or(dataset), &mut outcome);
    by_poses(dataset, &mut outcome);
    let nothing_shows = outcome.measured.is_empty() && outcome.skipped.is_none();
    if nothing_shows {
        outcome.skipped = Some(MotionSkip::NoRoad.into());
    }
    match fastest(dataset) {
        Some((time_s, speed_mps)) if speed_mps.abs() > MOST_MPS => {
            too_fast(dataset, time_s, speed_mps, &mut outcome);
        }
        Some((_, speed_mps)) if nothing_shows => {
            let fastest_mps = speed_mps.abs();
            let unchecked = MotionReason::Unchecked { fastest_mps };
            outcome.find(Severity::Note, None, unchecked);
        }
        _ => {}
    }
    outcome
}

/// The highest speed, forwards or backwards, from the first frame to the last, with its time: at a frame, or between two.
fn fastest(dataset: &Dataset) -> Option<(f64, f64)> {
    let track = dataset.track()?;
    let frames = dataset.frames().iter().filter_map(|frame| frame.time_s);
    let first = frames.clone().reduce(f64::min)?;
    let last = frames.clone().reduce(f64::max)?;
    let samples = track.times_s().iter().copied();
    let between = samples.filter(|time_s| (first..=last).contains(time_s));
    let speeds = frames.chain(between).filter_map(|time_s| {
        let speed_mps = track.speed_at(time_s)?;
        Some((time_s, speed_mps))
    });
    speeds.max_by(|a, b| a.1.abs().total_cmp(&b.1.abs()))
}

/// Reports a speed above the limit. One within it is no figure of this check, since it does not show that the speeds are right.
fn too_fast(dataset: &Dataset, time_s: f64, speed_mps: f64, outcome: &mut Outcome) {
    let limit = Limit::AtMost(MOST_MPS);
    let figure = Figure::new("fastest", speed_mps.abs(), "m/s", limit);
    let taken = |frame: &&Frame| frame.time_s.is_some_and(|taken_s| taken_s <= time_s);
    let frame = dataset.frames().iter().rev().find(taken);
    let number = frame.map(|frame| frame.number);
    outcome.judge_at(Severity::Warning, number, figure, || {
        MotionReason::TooFast { speed_mps, time_s }
    });
}

fn by_road(dataset: &Dataset, outcome: &mut Outcome) {
    let (height_m, pairs) = match road_camera_height(dataset) {
        Ok(Some(seen)) => seen,
        Ok(None) => return,
        Err(error) => {
            outcome.skipped = Some(SharedError::from(error).into());
            return;
        }
    };
    let limit = Limit::Within(*PLAUSIBLE_HEIGHT_M.start(), *PLAUSIBLE_HEIGHT_M.end());
    let figure = Figure::new("camera height by the road's motion", height_m, "m", limit);
    outcome.judge(Severity::Error, figure, || {
        MotionReason::Road(SpeedWarning {
            implied_height_m: height_m,
            pairs,
        })
    });
}

/// A bag's poses come from another unit than its speeds; elsewhere both come from one unit.
fn by_poses(dataset: &Dataset, outcome: &mut Outcome) {
    if dataset.kind() != DatasetKind::Bag {
        return;
    }
    let (Some(track), Some(mount)) = (dataset.track(), dataset.cam_from_vehicle()) else {
        return;
    };
    let Ok(paths) = dataset.camera_paths() else {
        return;
    };
    let (mut by_poses, mut by_speeds) = (0.0, 0.0);
    for CameraPath {
        times_s,
        world_from_cam,
        ..
    } in &paths
    {
        // From a pose to one some metres on: poses that jitter from frame to frame cover a longer distance than the vehicle.
        let (mut begin, mut moved, mut way) = (0, Se3::identity(), 0.0);
        for (i, times) in times_s.windows(2).enumerate() {
            let Some(motion) = track.motion(times[0], times[1]) else {
                (begin, moved, way) = (i + 1, Se3::identity(), 0.0);
                continue;
            };
            let step = motion.camera0_from_camera1(&mount);
            way += step.translation().norm();
            moved = moved * step;
            if way >= STRETCH_M {
                let [from, to] = [begin, i + 1].map(|i| world_from_cam[i].translation());
                by_speeds += moved.translation().norm();
                by_poses += (to - from).norm();
                (begin, moved, way) = (i + 1, Se3::identity(), 0.0);
            }
        }
    }
    if by_speeds.max(by_poses) < LEAST_WAY_M {
        return;
    }
    let ratio = by_poses / by_speeds;
    let figure = Figure::new(
        "distance by the poses over distance by the speeds",
        ratio,
        "",
        RATIO,
    );
    outcome.judge(Severity::Error, figure, || MotionReason::Poses {
        by_poses_m: by_poses,
        by_speeds_m: by_speeds,
        depth_factor: 1.0 / ratio,
    });
}
