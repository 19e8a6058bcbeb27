//! Computes speed, yaw rate, roll and pitch of a vehicle from its poses.

use crate::logs::clock::seconds;
use crate::logs::samples::Samples;
use crate::logs::speed_log::SpeedLog;
use deepfusion_geometry::Se3;
use nalgebra::{Matrix2, Matrix3, Rotation3, Vector2, Vector3};
use std::f64::consts::{PI, TAU};
use std::path::Path;

/// Poses within this time before and after a moment are used for the speed at that moment, in seconds: at 10 Hz the two neighbours, with
/// nuScenes' 32 poses per second ten, which averages their jitter of centimetres.
const WINDOW_S: f64 = 0.16;
/// Poses farther apart are not bridged, as in [`crate::VehicleTrack`].
const MAX_GAP_S: f64 = 0.5;
/// Poses closer together than this count as one, in ns.
const MIN_STEP_NS: i64 = 2_000_000;
/// Shortest distance from which the direction of travel is determined, in metres.
const MIN_PATH_M: f64 = 20.0;
/// Least cosine of the angle between the camera's axis and the direction of travel: 20°.
const MIN_COSINE: f64 = 0.94;

/// The speeds of a vehicle (x forward, y left, z up, metres) from its poses in any fixed world frame, on the clock of their
/// times (ns). A pose without another within half a second has no speed.
///
/// Speed and yaw rate are slopes of a parabola through the nearby poses (least squares); for three poses at equal steps this is the
/// central difference. The speed is the velocity along the vehicle's x, the yaw rate that of the heading about the mean of its z.
pub(crate) fn speed_log(path: &Path, world_from_vehicle: &[(i64, Se3)]) -> SpeedLog {
    let level_from_world = upright(world_from_vehicle.iter().map(|(_, pose)| pose));
    let (mut ns, mut speeds, mut yaw_rates) = (Vec::new(), Vec::new(), Vec::new());
    let mut tilts_rad = Vec::new();
    // Recorders may repeat lines: leave out poses that are not later, or hardly later, than the previous one, since they give no slope.
    let mut rising: Vec<(i64, Se3)> = Vec::with_capacity(world_from_vehicle.len());
    for pose in world_from_vehicle {
        if rising
            .last()
            .is_none_or(|last| pose.0.saturating_sub(last.0) >= MIN_STEP_NS)
        {
            rising.push(*pose);
        }
    }
    let near = |a: &(i64, Se3), b: &(i64, Se3)| seconds(b.0, a.0) <= MAX_GAP_S;
    for stretch in rising.chunk_by(near).filter(|s| s.len() > 1) {
        let attitudes = stretch.iter().map(|(_, pose)| {
            let attitude = level_from_world * pose.rotation();
            Rotation3::from_matrix_unchecked(attitude).euler_angles()
        });
        let attitudes: Vec<(f64, f64, f64)> = attitudes.collect();
        let headings = unwrapped(attitudes.iter().map(|(_, _, yaw)| *yaw));
        for (i, (time, pose)) in stretch.iter().enumerate() {
            let nearby = neighbours(stretch, i);
            let times: Vec<f64> = stretch[nearby.clone()]
                .iter()
                .map(|(t, _)| seconds(*t, *time))
                .collect();
            let weights = slope_weights(&times);
            let places = stretch[nearby.clone()].iter().map(|(_, p)| p.translation());
            let velocity = weights.iter().zip(places).map(|(w, p)| p * *w);
            let velocity: Vector3<f64> = velocity.sum();
            let headings = weights.iter().zip(&headings[nearby]);
            ns.push(*time);
            speeds.push(velocity.dot(&pose.rotate(&Vector3::x())));
            yaw_rates.push(headings.map(|(w, heading)| w * heading).sum());
            tilts_rad.push((*time, [attitudes[i].0, attitudes[i].1]));
        }
    }
    SpeedLog {
        path: path.to_owned(),
        speeds_mps: Samples {
            ns: ns.clone(),
            values: speeds,
        },
        yaw_rates_radps: Some(Samples {
            ns,
            values: yaw_rates,
        }),
        course_rates_radps: None,
        sigmas_mps: None,
        tilts_rad,
        vehicle: None,
        // The poses are reported as a stream of their own.
        streams: Vec::new(),
        warnings: Vec::new(),
    }
}

/// The transform from the vehicle to a camera of which only the position is known (`vehicle_in_cam`: the vehicle's origin in the camera,
/// metres). The vehicle's forward axis is the direction in which its origin moves, and its left axis is level with the camera. If the path
/// is too short, the camera is assumed to look straight ahead.
pub(crate) fn cam_from_vehicle(world_from_cam: &[Se3], vehicle_in_cam: Vector3<f64>) -> Se3 {
    let (mut forward, mut path_m) = (Vector3::zeros(), 0.0);
    for pair in world_from_cam.windows(2) {
        let place = |pose: &Se3| pose.transform(&vehicle_in_cam);
        let moved = place(&pair[1]) - place(&pair[0]);
        // The chord of an arc has the direction halfway between both attitudes.
        let middle = pair[0].interpolate(&pair[1], 0.5).inverse();
        let moved = middle.rotate(&moved);
        // Flip the direction when reversing.
        forward += moved * moved.z.signum();
        path_m += moved.norm();
    }
    let ahead = forward / forward.norm().max(1e-9);
    let forward = if path_m >= MIN_PATH_M && ahead.z >= MIN_COSINE {
        ahead
    } else {
        Vector3::z()
    };
    let left = (-Vector3::y()).cross(&forward).normalize();
    let axes = Matrix3::from_columns(&[forward, left, forward.cross(&left)]);
    Se3::from_parts(&axes, vehicle_in_cam)
}

/// The rotation of the world that makes the poses' mean z point up. It does not change motions between poses, but a vertical
/// near the true one keeps roll and pitch small.
fn upright<'a>(poses: impl Iterator<Item = &'a Se3>) -> Matrix3<f64> {
    let up: Vector3<f64> = poses.map(|pose| pose.rotate(&Vector3::z())).sum();
    // If the world's z points exactly down, the shortest rotation is not unique.
    let turn = Rotation3::rotation_between(&up, &Vector3::z());
    *turn
        .unwrap_or_else(|| Rotation3::from_axis_angle(&Vector3::x_axis(), PI))
        .matrix()
}

/// The angles without jumps by a full turn.
fn unwrapped(angles: impl Iterator<Item = f64>) -> Vec<f64> {
    let mut all: Vec<f64> = Vec::new();
    for angle in angles {
        let last = all.last().copied().unwrap_or(angle);
        all.push(last + (angle - last + PI).rem_euclid(TAU) - PI);
    }
    all
}

/// The poses used for the speed at `i`: those within the window, and at least three if possible.
fn neighbours(stretch: &[(i64, Se3)], i: usize) -> std::ops::Range<usize> {
    let away = |j: usize| seconds(stretch[j].0, stretch[i].0).abs();
    let (mut from, mut to) = (i, i + 1);
    while from > 0 && away(from - 1) <= WINDOW_S {
        from -= 1;
    }
    while to < stretch.len() && away(to) <= WINDOW_S {
        to += 1;
    }
    // Add one on each side first, since slopes at a window's end are the least accurate.
    if from == i {
        from = from.saturating_sub(1);
    }
    if to == i + 1 {
        to = (to + 1).min(stretch.len());
    }
    if to - from < 3 && from == 0 {
        to = stretch.len().min(3);
    } else if to - from < 3 {
        from = to.saturating_sub(3);
    }
    from..to
}

/// Weights for values at times (s) whose weighted sum is the slope at 0 of the least-squares parabola through them; of a straight line
/// for two values.
fn slope_weights(times_s: &[f64]) -> Vec<f64> {
    let power = |k: i32| times_s.iter().map(|t| t.powi(k)).sum::<f64>();
    let [n, s1, s2, s3, s4] = [0, 1, 2, 3, 4].map(power);
    let parabola = Matrix3::new(n, s1, s2, s1, s2, s3, s2, s3, s4).try_inverse();
    let line = Matrix2::new(n, s1, s1, s2).try_inverse();
    let weight = |t: &f64| match (&parabola, &line) {
        (Some(inverse), _) if times_s.len() > 2 => (inverse * Vector3::new(1.0, *t, t * t))[1],
        (_, Some(inverse)) => (inverse * Vector2::new(1.0, *t))[1],
        _ => 0.0,
    };
    times_s.iter().map(weight).collect()
}

#[cfg(test)]
#[path = "pose_track_tests.rs"]
mod tests;
