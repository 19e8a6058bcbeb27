//! The speeds compared with the road in the images, and with the recording's own poses.

use super::finding::{Figure, Limit, Outcome, Severity};
use super::reason::MotionReason;
use super::shared_error::SharedError;
use super::skip::MotionSkip;
use super::turning::turning_as_seen;
use deepfusion_data::{
    CameraPath, Dataset, DatasetKind, PLAUSIBLE_HEIGHT_M, SpeedWarning, road_camera_height,
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
    if outcome.measured.is_empty() && outcome.skipped.is_none() {
        outcome.skipped = Some(MotionSkip::NoRoad.into());
        if let Some(fastest_mps) = fastest_mps(dataset) {
            let unchecked = MotionReason::Unchecked { fastest_mps };
            outcome.find(Severity::Note, None, unchecked);
        }
    }
    outcome
}

/// The highest speed at the time of a frame.
fn fastest_mps(dataset: &Dataset) -> Option<f64> {
    let track = dataset.track()?;
    let times = dataset.frames().iter().filter_map(|frame| frame.time_s);
    let speeds = times.filter_map(|time_s| Some(track.speed_at(time_s)?.abs()));
    speeds.max_by(f64::total_cmp)
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
