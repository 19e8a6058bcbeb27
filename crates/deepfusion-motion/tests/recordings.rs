//! Distance and heading on real drives, compared with satellite positions.

use crate::support::{self, errors, halves, kitti, real_data, rows, speed_scale, windows};
use deepfusion_motion::comma::CommaSegment;
use deepfusion_motion::{FusedTrack, IdentifyConfig, MotionConfig, UnidentifiableReason, identify};

fn rav4() -> MotionConfig {
    toml::from_str(include_str!("../examples/rav4_2017.toml")).unwrap()
}

fn segment() -> Option<CommaSegment> {
    let path = real_data("comma/Example_1_seg40")?;
    Some(CommaSegment::open(&path).unwrap())
}

#[test]
fn a_comma_segments_axes_and_clocks_are_those_of_its_pose() {
    let Some(segment) = segment() else { return };
    let track = FusedTrack::new(&segment.sensors, &rav4()).unwrap();
    let imu = track.imu().unwrap();
    // Rotation between poses two frames apart, in vehicle axes, compared with the gyro's integral.
    let poses = segment.reference.poses();
    let mut sums = [[0.0; 3]; 3];
    for pair in poses[20..poses.len() - 20].windows(3) {
        let (a, b) = (&pair[0], &pair[2]);
        let turn = (a.world_from_body.inverse() * b.world_from_body).axis_angle();
        let gyro = [imu.roll_rate(), imu.pitch_rate(), imu.yaw_rate()]
            .map(|rate| rate.integral(a.time_s, b.time_s).unwrap());
        for axis in 0..3 {
            let terms = [
                turn[axis] * gyro[axis],
                turn[axis].powi(2),
                gyro[axis].powi(2),
            ];
            for (sum, term) in sums[axis].iter_mut().zip(terms) {
                *sum += term;
            }
        }
    }
    for (axis, [both, pose, gyro]) in sums.into_iter().enumerate() {
        let correlation = both / (pose * gyro).sqrt();
        assert!(correlation > 0.9, "axis {axis}: {correlation}");
    }
    assert_eq!(segment.wheel_speeds_mps.len(), 4);
    assert_eq!(segment.frame_times_s.len(), 1200);
}

#[test]
fn on_a_comma_segment_the_fusion_is_better_than_its_parts_where_they_err_apart() {
    let Some(segment) = segment() else { return };
    let track = FusedTrack::new(&segment.sensors, &rav4()).unwrap();
    let truths = windows(&segment.reference, 10.0, 0.5);
    assert!(truths.len() > 90);
    let [(_, vehicle), (_, imu), (_, fused)] = rows(&track, &truths);
    // Yaw: the errors of gyro and steering have opposite signs.
    assert!(
        fused.yaw_rad <= vehicle.yaw_rad.min(imu.yaw_rad),
        "{fused:?}"
    );
    // Distance: the wheels read 0.9 % low, and the accelerometer starts from their speed.
    assert!(vehicle.distance_bias.abs() < 0.012 && imu.distance_bias.abs() < 0.012);
    assert!(
        fused.distance_m <= vehicle.distance_m.min(imu.distance_m) + 1e-3,
        "{fused:?}"
    );
    // Between two frames, where it is used, nothing drifts noticeably.
    let short = windows(&segment.reference, 0.1, 0.5);
    let motion = |t: &support::Truth| {
        let motion = track.motion(t.from_s, t.to_s)?;
        Some((motion.distance_m, motion.yaw_rad))
    };
    let errors = errors(&short, motion);
    assert!(
        errors.windows > 100 && errors.distance_bias.abs() < 0.012,
        "{errors:?}"
    );
    assert!(errors.yaw_rad < 1e-3, "{errors:?}");
}

#[test]
fn with_the_tyres_known_the_fusion_is_no_worse_than_the_better_of_its_parts() {
    let Some(segment) = segment() else { return };
    let (first, second) = halves(&segment.reference);
    let config = MotionConfig {
        speed_scale: speed_scale(&segment.sensors.speed_mps, &first),
        ..rav4()
    };
    assert!(
        (config.speed_scale - 1.009).abs() < 0.002,
        "{}",
        config.speed_scale
    );
    let track = FusedTrack::new(&segment.sensors, &config).unwrap();
    // The same windows as in docs/concepts/ego-motion.md.
    let truths = windows(&second, 10.0, 0.1);
    assert!(truths.len() > 140, "{}", truths.len());
    let [(_, vehicle), (_, imu), (_, fused)] = rows(&track, &truths);
    eprintln!("{vehicle:?}\n{imu:?}\n{fused:?}");
    assert!(vehicle.distance_bias.abs() < 0.003, "{vehicle:?}");
    assert!(fused.distance_bias.abs() < 0.003, "{fused:?}");
    // Distance and yaw are no worse than the better part, to the document's digits: a millimetre and a hundredth of a degree.
    assert!(
        fused.distance_m <= vehicle.distance_m.min(imu.distance_m) + 1e-3,
        "{fused:?} {vehicle:?} {imu:?}"
    );
    assert!(
        fused.yaw_rad <= vehicle.yaw_rad.min(imu.yaw_rad) + 0.01_f64.to_radians(),
        "{fused:?} {vehicle:?} {imu:?}"
    );
    // Neither part is so poor that any mean would be better.
    assert!(imu.distance_m > vehicle.distance_m + 0.1 && vehicle.yaw_rad > 2.0 * imu.yaw_rad);
}

#[test]
fn a_motorway_minute_is_too_straight_to_identify_the_car() {
    let Some(segment) = segment() else { return };
    let track = FusedTrack::new(&segment.sensors, &rav4()).unwrap();
    let sensors = &segment.sensors;
    let known = IdentifyConfig {
        wheelbase_m: Some(2.65),
        ..IdentifyConfig::default()
    };
    let steering = sensors.steering_rad.as_ref().unwrap();
    let yaw_rate = track.imu().unwrap().yaw_rate();
    let error = identify(&sensors.speed_mps, steering, yaw_rate, &known).unwrap_err();
    assert_eq!(error.why, UnidentifiableReason::Straight, "{error}");
}

#[test]
fn kittis_speed_integrates_to_the_gps_path() {
    for (drive, frames) in [("0005", 154), ("0009", 447), ("0009", 51)] {
        let name = format!("kitti_raw/2011_09_26/2011_09_26_drive_{drive}_sync");
        let Some(path) = real_data(&name) else { return };
        let all = kitti::packets(&path);
        let packets = &all[..frames];
        let track = kitti::track(packets);
        let (from, to) = (packets[0].time_s, packets[frames - 1].time_s);
        let motion = track.motion(from, to).unwrap();
        // Position noise lengthens a path through all positions, and cutting corners shortens one through few. For every fifth position
        // (half a second) the two differ by less than 0.1 % here.
        let length = kitti::path_length_m(packets, 5);
        assert!((kitti::path_length_m(packets, 1) / length - 1.0).abs() < 1e-3);
        let off = motion.distance_m / length - 1.0;
        eprintln!(
            "{drive}, {frames} packets: ∫vf {:.2} m, GPS {length:.2} m",
            motion.distance_m
        );
        assert!(off.abs() < 0.03, "{drive}: {off}");
        let turned = packets[frames - 1].heading_rad() - packets[0].heading_rad() - motion.yaw_rad;
        assert!(turned.sin().abs() < 0.02, "{drive}: {turned}");
    }
}
