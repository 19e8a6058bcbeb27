//! Real recordings for tests and the example: where they are, and how a motion is compared with a
//! reference.

#![allow(
    dead_code,
    clippy::unwrap_used,
    clippy::expect_used,
    reason = "the example has a part of it, too"
)]

pub(crate) mod kitti;

use deepfusion_geometry::Trajectory;
use deepfusion_motion::{FusedTrack, MotionParts, Signal};
use std::path::{Path, PathBuf};

/// A folder of real recordings: below `DEEPFUSION_DATA`, or `../shared/data` beside the workspace. Says
/// so and gives nothing where it is absent.
pub(crate) fn real_data(inner: &str) -> Option<PathBuf> {
    let workspace = Path::new(env!("CARGO_MANIFEST_DIR")).join("../..");
    let root = std::env::var_os("DEEPFUSION_DATA")
        .map_or_else(|| workspace.join("../shared/data"), PathBuf::from);
    let path = root.join(inner);
    if path.exists() {
        return Some(path);
    }
    eprintln!(
        "skipped: {} is not there (set DEEPFUSION_DATA)",
        path.display()
    );
    None
}

/// What is true about one interval.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Truth {
    pub from_s: f64,
    pub to_s: f64,
    pub distance_m: f64,
    pub yaw_rad: f64,
}

/// Every interval of `length_s` of a reference path, one starting every `every_s`. Distance is the sum
/// of the steps between poses, yaw the change of heading.
pub(crate) fn windows(reference: &Trajectory, length_s: f64, every_s: f64) -> Vec<Truth> {
    let poses = reference.poses();
    let (mut along, mut heading) = (vec![0.0], vec![0.0]);
    for pair in poses.windows(2) {
        let [a, b] = [&pair[0].world_from_body, &pair[1].world_from_body];
        along.push(along[along.len() - 1] + (b.translation() - a.translation()).norm());
        let angle = |r: nalgebra::Matrix3<f64>| r[(1, 0)].atan2(r[(0, 0)]);
        let turn = angle(b.rotation()) - angle(a.rotation());
        heading.push(heading[heading.len() - 1] + turn.sin().atan2(turn.cos()));
    }
    let mut found: Vec<Truth> = Vec::new();
    for (i, first) in poses.iter().enumerate() {
        let last_start = found.last().map_or(f64::NEG_INFINITY, |w| w.from_s);
        let end = poses.partition_point(|p| p.time_s < first.time_s + length_s);
        if first.time_s < last_start + every_s || end == poses.len() {
            continue;
        }
        found.push(Truth {
            from_s: first.time_s,
            to_s: poses[end].time_s,
            distance_m: along[end] - along[i],
            yaw_rad: heading[end] - heading[i],
        });
    }
    found
}

/// A path cut in two at half its time.
pub(crate) fn halves(path: &Trajectory) -> (Trajectory, Trajectory) {
    let poses = path.poses();
    let (first, second) = poses.split_at(poses.len() / 2);
    (
        Trajectory::new(first.to_vec()),
        Trajectory::new(second.to_vec()),
    )
}

/// The path's length over the speed's integral.
pub(crate) fn speed_scale(speed: &Signal, path: &Trajectory) -> f64 {
    let poses = path.poses();
    let integral = speed.integral(poses[0].time_s, poses[poses.len() - 1].time_s);
    path.length_m() / integral.unwrap()
}

/// Errors over windows.
#[derive(Debug, Clone, Copy, Default)]
pub(crate) struct Errors {
    /// Mean of the signed error of the distance, over the mean distance.
    pub distance_bias: f64,
    /// Mean of its absolute value, in metres.
    pub distance_m: f64,
    /// Mean of the signed error of the yaw, in radians.
    pub yaw_bias_rad: f64,
    /// Mean of its absolute value, in radians.
    pub yaw_rad: f64,
    pub windows: usize,
}

/// The errors of distances and yaws, each window's as (distance in m, yaw in rad).
pub(crate) fn errors(truths: &[Truth], of: impl Fn(&Truth) -> Option<(f64, f64)>) -> Errors {
    let mut sum = Errors::default();
    let mut driven = 0.0;
    for truth in truths {
        let Some((distance, yaw)) = of(truth) else {
            continue;
        };
        sum.windows += 1;
        driven += truth.distance_m;
        sum.distance_bias += distance - truth.distance_m;
        sum.distance_m += (distance - truth.distance_m).abs();
        sum.yaw_bias_rad += yaw - truth.yaw_rad;
        sum.yaw_rad += (yaw - truth.yaw_rad).abs();
    }
    let n = sum.windows.max(1) as f64;
    Errors {
        distance_bias: sum.distance_bias / driven,
        distance_m: sum.distance_m / n,
        yaw_bias_rad: sum.yaw_bias_rad / n,
        yaw_rad: sum.yaw_rad / n,
        windows: sum.windows,
    }
}

/// The three rows of the table: vehicle only, inertial unit only, fused.
pub(crate) fn rows(track: &FusedTrack, truths: &[Truth]) -> [(&'static str, Errors); 3] {
    let parts = |t: &Truth| track.parts(t.from_s, t.to_s);
    let vehicle = |p: MotionParts| Some((p.vehicle_distance_m, p.steering_yaw_rad?));
    let imu = |p: MotionParts| Some((p.imu_distance_m?, p.imu_yaw_rad?));
    let fused = |t: &Truth| {
        let motion = track.motion(t.from_s, t.to_s)?;
        Some((motion.distance_m, motion.yaw_rad))
    };
    [
        (
            "vehicle only",
            errors(truths, |t| parts(t).and_then(vehicle)),
        ),
        ("IMU only", errors(truths, |t| parts(t).and_then(imu))),
        ("fused", errors(truths, fused)),
    ]
}
