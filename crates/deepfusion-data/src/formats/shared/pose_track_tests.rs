use super::*;
use crate::MotionModel;

/// An upright vehicle at a position with a heading, in a world whose z points up.
fn pose(x: f64, y: f64, heading: f64) -> Se3 {
    Se3::from_axis_angle(Vector3::new(0.0, 0.0, heading), Vector3::new(x, y, 0.0))
}

fn ns(time_s: f64) -> i64 {
    1_400_000_000_000_000_000 + (time_s * 1e9).round() as i64
}

/// Poses on a circle of radius `r` at a constant speed, at these times.
fn circle(r: f64, speed: f64, times: &[f64]) -> Vec<(i64, Se3)> {
    let at = |t: &f64| {
        let angle = speed * t / r;
        (
            ns(*t),
            pose(r * angle.sin(), r * (1.0 - angle.cos()), angle),
        )
    };
    times.iter().map(at).collect()
}

fn log(poses: &[(i64, Se3)]) -> SpeedLog {
    speed_log(Path::new("poses.txt"), poses)
}

/// For a straight drive at constant acceleration, a parabola is exact: at equal and unequal steps, at both ends, and in reverse.
#[test]
fn a_parabola_is_exact_for_constant_acceleration() {
    let times = [0.0, 0.1, 0.19, 0.31, 0.4, 0.42, 0.55, 0.9, 1.3];
    let at = |t: &f64| (ns(*t), pose(1000.0 + 4.0 * t - 1.5 * t * t, -300.0, 0.0));
    let poses: Vec<_> = times.iter().map(at).collect();
    let log = log(&poses);
    assert_eq!(log.speeds_mps.ns.len(), times.len());
    for (t, v) in times.iter().zip(&log.speeds_mps.values) {
        assert!((v - (4.0 - 3.0 * t)).abs() < 1e-8, "{v} at {t}");
    }
    let turns = &log.yaw_rates_radps.unwrap().values;
    assert!(turns.iter().all(|w| w.abs() < 1e-9), "{turns:?}");
}

/// Central differences on a circle: the chord over 2h instead of the arc is too short by a fraction of (ωh)²/6; at the ends, with a
/// parabola through one side, by twice that. The heading is linear in time, so its slope is exact.
#[test]
fn speeds_on_a_circle_are_accurate_to_second_order() {
    let (r, speed, h) = (12.0, 6.0, 0.1);
    let times: Vec<f64> = (0..30).map(|i| f64::from(i) * h).collect();
    let log = log(&circle(r, speed, &times));
    let omega = speed / r;
    let order = (omega * h).powi(2);
    let yaw_rates = log.yaw_rates_radps.clone().unwrap().values;
    for (i, (v, w)) in log.speeds_mps.values.iter().zip(&yaw_rates).enumerate() {
        let end = i == 0 || i + 1 == times.len();
        let off = (speed - v) / speed / order;
        let expected = if end { -1.0 / 3.0 } else { 1.0 / 6.0 };
        assert!((off - expected).abs() < 0.01, "{i}: {off} of the order");
        assert!((w - omega).abs() < 1e-9, "{i}: {w}");
    }
    // The motion between neighbours is the true one.
    let track: MotionModel = log.motion(ns(0.0)).unwrap().0;
    let motion = track.motion(1.0, 1.1).unwrap().vehicle0_from_vehicle1();
    let poses = circle(r, speed, &times);
    let truth = poses[10].1.inverse() * poses[11].1;
    let off = motion.inverse() * truth;
    assert!(
        off.translation().norm() < 1e-3 && off.angle() < 1e-9,
        "{off:?}"
    );
}

/// A world with z down or camera axes gives the same motions, since these are relative to the vehicle. A heading that passes half a turn
/// does not jump.
#[test]
fn motion_does_not_depend_on_the_worlds_axes() {
    let times: Vec<f64> = (0..80).map(|i| f64::from(i) * 0.1).collect();
    let poses = circle(10.0, 8.0, &times);
    let plain = log(&poses);
    for turn in [
        Vector3::new(std::f64::consts::PI, 0.0, 0.0),
        Vector3::new(-1.5, 0.1, 2.0),
    ] {
        let other_from_world = Se3::from_axis_angle(turn, Vector3::new(3.0, -2.0, 7.0));
        let turned: Vec<_> = poses
            .iter()
            .map(|(t, p)| (*t, other_from_world * *p))
            .collect();
        let turned = log(&turned);
        let close = |a: &Samples, b: &Samples| {
            let pairs = a.values.iter().zip(&b.values);
            pairs.fold(0.0_f64, |most, (a, b)| most.max((a - b).abs()))
        };
        assert!(close(&plain.speeds_mps, &turned.speeds_mps) < 1e-9);
        let (a, b) = (&plain.yaw_rates_radps, &turned.yaw_rates_radps);
        assert!(close(a.as_ref().unwrap(), b.as_ref().unwrap()) < 1e-9);
    }
}

/// A body that rolls and pitches: its rotation between two poses is that of the poses, up to the error of the yaw rate's slope.
#[test]
fn roll_and_pitch_are_those_of_the_poses() {
    let at = |i: i32| {
        let t = f64::from(i) * 0.1;
        let roll_and_pitch = Se3::from_axis_angle(
            Vector3::new(0.03 * (4.0 * t).sin(), 0.05 * (3.0 * t).cos(), 0.0),
            Vector3::zeros(),
        );
        (ns(t), pose(7.0 * t, 0.0, 0.2 * t) * roll_and_pitch)
    };
    let poses: Vec<_> = (0..40).map(at).collect();
    let track = log(&poses).motion(ns(0.0)).unwrap().0;
    let mount = Se3::cam_from_body_axes();
    for i in 5..30_usize {
        let t = i as f64 * 0.1;
        let moved = track
            .motion(t, t + 0.1)
            .unwrap()
            .camera0_from_camera1(&mount);
        let truth = mount * poses[i].1.inverse() * poses[i + 1].1 * mount.inverse();
        let off = (moved.inverse() * truth).angle();
        assert!(off < 5e-4, "{off} rad at {t}");
    }
}

/// Jitter of a centimetre: with 32 poses per second the slope's error is 3 cm/s; with only the two neighbours it would be 23.
#[test]
fn jitter_of_frequent_poses_is_averaged() {
    let mut state = 1_u64;
    let mut jitter = || {
        // A linear congruential generator; the sum of twelve uniform numbers is nearly normal.
        let mut uniform = || {
            state = state
                .wrapping_mul(6_364_136_223_846_793_005)
                .wrapping_add(1);
            (state >> 11) as f64 / (1_u64 << 53) as f64
        };
        0.01 * ((0..12).map(|_| uniform()).sum::<f64>() - 6.0)
    };
    let poses: Vec<_> = (0..640)
        .map(|i| {
            let t = f64::from(i) / 32.0;
            (ns(t), pose(9.0 * t + jitter(), jitter(), 0.0))
        })
        .collect();
    let speeds = log(&poses).speeds_mps.values;
    let square = speeds.iter().map(|v| (v - 9.0).powi(2)).sum::<f64>();
    let rms = (square / speeds.len() as f64).sqrt();
    // σ / √Σt² of the eleven times within 0.16 s, and a little more at the ends: 0.01 / 0.328 = 0.0305.
    assert!((0.02..0.045).contains(&rms), "{rms}");
}

/// Two poses give a straight line; a single pose, or one after a gap, has no speed.
#[test]
fn gaps_are_not_bridged() {
    let at = |t: f64| (ns(t), pose(5.0 * t, 0.0, 0.0));
    let poses = [0.0, 2.0, 2.1, 4.0, 4.1, 4.2].map(at);
    let log = log(&poses);
    let times: Vec<i64> = [2.0, 2.1, 4.0, 4.1, 4.2].map(ns).into();
    assert_eq!(log.speeds_mps.ns, times);
    assert!(log.speeds_mps.values.iter().all(|v| (v - 5.0).abs() < 1e-6));
}

/// A camera that looks two degrees up and one to the right of the direction of travel, 1 m ahead of the axle.
#[test]
fn the_cameras_direction_follows_from_the_path() {
    let nominal = Matrix3::new(0.0, -1.0, 0.0, 0.0, 0.0, -1.0, 1.0, 0.0, 0.0);
    let off = Rotation3::from_euler_angles(-0.035, 0.0175, 0.0);
    let rotation = off.matrix() * nominal;
    let vehicle_in_cam = rotation * -Vector3::new(1.0, 0.0, 0.7);
    let cam_from_car = Se3::from_parts(&rotation, vehicle_in_cam);
    let times: Vec<f64> = (0..60).map(|i| f64::from(i) * 0.1).collect();
    let poses: Vec<Se3> = circle(20.0, 8.0, &times)
        .iter()
        .map(|(_, pose)| *pose * cam_from_car.inverse())
        .collect();
    let found = cam_from_vehicle(&poses, vehicle_in_cam);
    // The camera's roll about that direction is not observable; here it is of second order.
    let error = (found.inverse() * cam_from_car).angle();
    assert!(error < 2e-3, "{error}");
    let forward = (found.inverse() * cam_from_car).rotate(&Vector3::x());
    assert!((forward - Vector3::x()).norm() < 1e-6, "{forward}");
    // Ten frames over 8 m are too short a path.
    let short = cam_from_vehicle(&poses[..10], vehicle_in_cam);
    assert!((short.rotate(&Vector3::x()) - Vector3::z()).norm() < 1e-12);
}
