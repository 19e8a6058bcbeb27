//! The inertial unit and the fusion on a drive with known motion: slopes, a tilted mount, biases.

use deepfusion_geometry::Se3;
use deepfusion_hint::Hint;
use deepfusion_motion::{
    Bicycle, Error, FusedTrack, FusionConfig, ImuConfig, ImuMount, ImuSample, ImuTrack,
    MotionConfig, MotionModel, Signal, VehicleSensors,
};
use nalgebra::Vector3;
use proptest::prelude::*;

const G: f64 = 9.806_65;
const GYRO_BIAS: [f64; 3] = [0.004, -0.006, 0.008];

/// Standing for 8 s, then 60 s of driving, then standing for 6 s.
fn speed(t: f64) -> f64 {
    let s = t - 8.0;
    if !(0.0..60.0).contains(&s) {
        return 0.0;
    }
    let ramp = (s / 6.0).min((60.0 - s) / 6.0).min(1.0);
    let ramp = ramp * ramp * (3.0 - 2.0 * ramp);
    ramp * (9.0 + 3.0 * (0.25 * s).sin())
}

fn yaw_rate(t: f64) -> f64 {
    speed(t) * 0.03 * (0.2 * t).sin()
}

/// The road's slope, as pitch (positive: nose down), including bumps.
fn pitch(t: f64) -> f64 {
    let slope = 0.04 * (0.11 * t.clamp(8.0, 68.0)).sin();
    slope + 0.0005 * speed(t) * (5.0 * t).sin()
}

fn derivative(f: impl Fn(f64) -> f64, t: f64) -> f64 {
    (f(t + 1e-4) - f(t - 1e-4)) / 2e-4
}

/// The readings of a unit mounted as `vehicle_from_imu`, at 100 Hz over 74 s.
fn imu(vehicle_from_imu: &Se3) -> Vec<ImuSample> {
    let imu_from_vehicle = vehicle_from_imu.inverse();
    let reading = |i: usize| {
        let t = i as f64 * 0.01;
        let (sin, cos) = pitch(t).sin_cos();
        // Level axes: forward v̇, left v·ψ̇, up g. Nose down tilts x towards −z.
        let level = Vector3::new(derivative(speed, t), speed(t) * yaw_rate(t), G);
        let force = Vector3::new(
            level.x * cos - level.z * sin,
            level.y,
            level.x * sin + level.z * cos,
        );
        let rate = Vector3::new(-yaw_rate(t) * sin, derivative(pitch, t), yaw_rate(t) * cos);
        let wobble = |k: f64| 0.05 * (k * t).sin();
        let noisy = force + Vector3::new(wobble(211.0), wobble(173.0), wobble(199.0));
        ImuSample {
            time_s: t,
            acceleration_mps2: imu_from_vehicle.rotate(&noisy),
            angular_rate_radps: imu_from_vehicle.rotate(&(rate + Vector3::from(GYRO_BIAS))),
        }
    };
    (0..7400).map(reading).collect()
}

fn speed_signal() -> Signal {
    Signal::new((0..3700).map(|i| (f64::from(i) * 0.02, speed(f64::from(i) * 0.02))))
}

fn exact(f: impl Fn(f64) -> f64, from: f64, to: f64) -> f64 {
    let n = 2000;
    let h = (to - from) / f64::from(n);
    (0..n).map(|i| f(from + (f64::from(i) + 0.5) * h) * h).sum()
}

fn upside_down() -> ImuMount {
    ImuMount::forward_right_down()
}

#[test]
fn distance_and_heading_survive_slopes_biases_and_any_mount() {
    for mount in [ImuMount::default(), upside_down()] {
        let config = ImuConfig {
            vehicle_from_imu: mount,
            ..ImuConfig::default()
        };
        let track = ImuTrack::new(&imu(&mount.se3()), &speed_signal(), &config).unwrap();
        assert_eq!(track.standstills().len(), 2, "{:?}", track.standstills());
        let bias = track.standstills()[0].gyro_bias_radps;
        assert!((bias - Vector3::from(GYRO_BIAS)).norm() < 2e-3, "{bias}");
        for step in 0..60 {
            let (from, to) = (10.0 + f64::from(step), 11.0 + f64::from(step));
            let distance = track.distance(from, to, speed(from)).unwrap();
            // A tenth of a m/s² over a second is allowed: slopes change faster than the filter follows.
            let error = distance - exact(speed, from, to);
            assert!(error.abs() < 0.05, "{from}: {error}");
            let error = track.yaw(from, to).unwrap() - exact(yaw_rate, from, to);
            assert!(error.abs() < 1.5e-3, "{from}: {error}");
        }
        let turned = track.yaw(8.0, 68.0).unwrap() - exact(yaw_rate, 8.0, 68.0);
        assert!(turned.abs() < 0.03, "{turned}");
    }
}

#[test]
fn a_known_bias_helps_without_a_standstill() {
    let samples: Vec<ImuSample> = imu(&Se3::identity()).split_off(1500);
    let samples = &samples[..4000];
    let heading_error = |config: &ImuConfig| {
        let track = ImuTrack::new(samples, &speed_signal(), config).unwrap();
        assert!(track.standstills().is_empty());
        (track.yaw(16.0, 46.0).unwrap() - exact(yaw_rate, 16.0, 46.0)).abs()
    };
    let known = ImuConfig {
        gyro_bias_radps: Some(GYRO_BIAS),
        ..ImuConfig::default()
    };
    let (without, with) = (heading_error(&ImuConfig::default()), heading_error(&known));
    assert!(with < 0.02 && without > 0.2, "{with} {without}");
}

#[test]
fn a_unit_that_contradicts_its_configuration_is_refused() {
    let refused = |samples: &[ImuSample]| {
        let error = ImuTrack::new(samples, &speed_signal(), &ImuConfig::default()).unwrap_err();
        (error.hint().unwrap(), error)
    };
    let (hint, error) = refused(&imu(&upside_down().se3()));
    assert!(matches!(error, Error::NotUp { .. }), "{error}");
    assert!(hint.contains("upside down"), "{hint}");

    let quarter = Se3::from_axis_angle(Vector3::y() * 1.6, Vector3::zeros());
    let (hint, error) = refused(&imu(&quarter));
    assert!(
        error.to_string().contains("away from the vehicle's z"),
        "{error}"
    );
    assert!(hint.contains("rotation"), "{hint}");

    let scaled = |factor: f64| {
        let change = |s: &ImuSample| ImuSample {
            acceleration_mps2: s.acceleration_mps2 * factor,
            ..*s
        };
        imu(&Se3::identity()).iter().map(change).collect::<Vec<_>>()
    };
    assert!(refused(&scaled(1.0 / G)).0.contains("multiples of g"));
    assert!(refused(&scaled(1000.0)).0.contains("m/s²"));
    let mut without = imu(&Se3::identity());
    without.iter_mut().for_each(|s| s.acceleration_mps2.z -= G);
    assert!(refused(&without).0.contains("removed"));

    let (_, error) = refused(&[]);
    assert!(
        error.to_string().contains("0 usable samples of 0"),
        "{error}"
    );
    let bad = ImuConfig {
        attitude_time_s: f64::NAN,
        ..ImuConfig::default()
    };
    let error = ImuTrack::new(&imu(&Se3::identity()), &speed_signal(), &bad).unwrap_err();
    assert!(error.to_string().contains("attitude_time_s"), "{error}");
}

fn bicycle() -> Bicycle {
    Bicycle::new(2.7).with_steering_wheel(15.0)
}

/// The steering wheel's angle for this drive, 2 % too large.
fn steering() -> Signal {
    let angle = |t: f64| {
        if speed(t) > 0.1 {
            (2.7 * yaw_rate(t) / speed(t)).atan()
        } else {
            0.0
        }
    };
    Signal::new((0..3700).map(|i| {
        let t = f64::from(i) * 0.02;
        (t, 15.0 * 1.02 * angle(t))
    }))
}

fn all() -> VehicleSensors {
    VehicleSensors {
        speed_mps: speed_signal().map(|v| 1.01 * v),
        steering_rad: Some(steering()),
        imu: Some(imu(&Se3::identity())),
    }
}

fn config() -> MotionConfig {
    MotionConfig {
        bicycle: Some(bicycle()),
        ..MotionConfig::default()
    }
}

#[test]
fn the_fusion_is_the_weighted_mean() {
    let fused = |fusion: FusionConfig| {
        let config = MotionConfig { fusion, ..config() };
        let track = FusedTrack::new(&all(), &config).unwrap();
        let parts = track.parts(20.0, 20.5).unwrap();
        (track.motion(20.0, 20.5).unwrap(), parts)
    };
    let (motion, parts) = fused(FusionConfig::default());
    let distance = 0.1 * parts.imu_distance_m.unwrap() + 0.9 * parts.vehicle_distance_m;
    assert!((motion.distance_m - distance).abs() < 1e-12);
    assert!((parts.vehicle_distance_m / exact(speed, 20.0, 20.5) - 1.01).abs() < 1e-4);
    assert!((parts.steering_yaw_rad.unwrap() / exact(yaw_rate, 20.0, 20.5) - 1.03).abs() < 2e-3);
    let yaw_by = |alpha_yaw| {
        let fusion = FusionConfig {
            alpha_yaw,
            ..FusionConfig::default()
        };
        fused(fusion).0.yaw_rad
    };
    let (gyro, steering) = (yaw_by(1.0), yaw_by(0.0));
    assert!((motion.yaw_rad - 0.9 * gyro - 0.1 * steering).abs() < 1e-12);
    // The steering's error of 3 % shows in the bends, so most of it is removed from the fused yaw.
    assert!((steering / exact(yaw_rate, 20.0, 20.5) - 1.0).abs() < 0.01);
}

/// The middle of the drive: the vehicle does not stand from 15 to 55 s.
fn without_standstill() -> VehicleSensors {
    let mut sensors = all();
    let imu = sensors.imu.as_mut().unwrap();
    imu.retain(|s| (15.0..55.0).contains(&s.time_s));
    sensors
}

#[test]
fn a_drive_without_a_stop_shows_the_gyros_bias_too() {
    let config = config();
    let track = FusedTrack::new(&without_standstill(), &config).unwrap();
    let imu = track.imu().unwrap();
    assert!(imu.standstills().is_empty());
    // The mean of the body's rates over the whole drive, where a bias would show.
    let roll_rate = |t: f64| -yaw_rate(t) * pitch(t).sin();
    let pitch_rate = |t: f64| derivative(pitch, t);
    let left = [
        imu.roll_rate().integral(16.0, 54.0).unwrap() - exact(roll_rate, 16.0, 54.0),
        imu.pitch_rate().integral(16.0, 54.0).unwrap() - exact(pitch_rate, 16.0, 54.0),
    ];
    for (left, bias) in left.into_iter().zip(GYRO_BIAS) {
        assert!(
            (left / 38.0).abs() < 0.25 * bias.abs(),
            "{left} of {bias} rad/s"
        );
    }
    let yaw_error = |track: &FusedTrack| {
        let error = |step: i32| {
            let from = 16.0 + f64::from(step);
            let yaw = track.motion(from, from + 1.0).unwrap().yaw_rad;
            (yaw - exact(yaw_rate, from, from + 1.0)).abs()
        };
        (0..37).map(error).sum::<f64>() / 37.0
    };
    // Without correction, 0.9 of the gyro's 0.008 rad/s would remain.
    let mut silent = config;
    silent.imu.gyro_bias_radps = Some([0.0; 3]);
    let (found, as_it_reads) = (
        yaw_error(&track),
        yaw_error(&FusedTrack::new(&without_standstill(), &silent).unwrap()),
    );
    assert!(
        as_it_reads > 6e-3 && found < 1.5e-3,
        "{as_it_reads} {found}"
    );
    // Where the steering is missing, the bias found elsewhere is still removed.
    let mut sensors = without_standstill();
    sensors.steering_rad = sensors.steering_rad.map(|steering| {
        let samples = steering
            .times_s()
            .iter()
            .copied()
            .zip(steering.values().iter().copied());
        Signal::new(
            samples
                .filter(|(t, _)| !(30.0..32.0).contains(t))
                .collect::<Vec<_>>(),
        )
    });
    let track = FusedTrack::new(&sensors, &self::config()).unwrap();
    let parts = track.parts(30.2, 31.2).unwrap();
    assert!(parts.steering_yaw_rad.is_none());
    let truly = exact(yaw_rate, 30.2, 31.2);
    let error = |yaw: f64| (yaw - truly).abs();
    let (raw, freed) = (
        parts.imu_yaw_rad.unwrap(),
        track.motion(30.2, 31.2).unwrap().yaw_rad,
    );
    assert!(
        error(raw) > 4e-3 && error(freed) < 2e-3,
        "{raw} {freed} {truly}"
    );
}

#[test]
fn roll_and_pitch_follow_the_gyro() {
    for sensors in [all(), without_standstill()] {
        let track = FusedTrack::new(&sensors, &config()).unwrap();
        let (mut error, mut usual) = (0.0_f64, 0.0_f64);
        for step in 0..340 {
            let (from, to) = (18.0 + 0.1 * f64::from(step), 18.4 + 0.1 * f64::from(step));
            let [roll, measured] = track.motion(from, to).unwrap().tilt_rad;
            let change = pitch(to) - pitch(from);
            error += (measured - change).powi(2);
            usual += change.powi(2);
            // A turn of θ on a slope rolls the body by −θ·sin(pitch).
            let turned = exact(yaw_rate, from, to);
            let rolled = roll + turned * pitch(from).sin();
            assert!(rolled.abs() < 1e-3, "{from}: {rolled}");
        }
        assert!(error.sqrt() < 0.2 * usual.sqrt(), "{error} {usual}");
    }
}

#[test]
fn an_absent_sensor_leaves_its_weight_to_the_other() {
    let only = |change: fn(&mut VehicleSensors)| {
        let mut sensors = all();
        change(&mut sensors);
        let track = FusedTrack::new(&sensors, &config()).unwrap();
        let motion = track.motion(20.0, 20.5).unwrap();
        (track.knows_yaw(), motion, track.parts(20.0, 20.5).unwrap())
    };
    let (knows, motion, parts) = only(|s| s.imu = None);
    assert!(knows && motion.distance_m == parts.vehicle_distance_m);
    assert_eq!(Some(motion.yaw_rad), parts.steering_yaw_rad);
    let (knows, motion, parts) = only(|s| s.steering_rad = None);
    assert!(knows && Some(motion.yaw_rad) == parts.imu_yaw_rad);
    let (knows, motion, _) = only(|s| (s.imu, s.steering_rad) = (None, None));
    assert!(!knows && motion.yaw_rad == 0.0);
    // A steering angle without the vehicle's geometry is not used.
    let track = FusedTrack::new(&all(), &MotionConfig::default()).unwrap();
    assert!(track.steering_yaw_rate().is_none());
    let mut nothing = all();
    nothing.speed_mps = Signal::default();
    let error = FusedTrack::new(&nothing, &config()).unwrap_err();
    assert!(error.to_string().contains("speed"), "{error}");
}

#[test]
fn gaps_are_refused_or_left_to_the_other_sensor() {
    let gap = |s: &Signal, from: f64, to: f64| {
        let kept = s.times_s().iter().copied().zip(s.values().iter().copied());
        Signal::new(
            kept.filter(|(t, _)| !(from..to).contains(t))
                .collect::<Vec<_>>(),
        )
    };
    let mut sensors = all();
    sensors.speed_mps = gap(&sensors.speed_mps, 20.0, 21.0);
    sensors.steering_rad = sensors.steering_rad.map(|s| gap(&s, 30.0, 31.0));
    sensors
        .imu
        .as_mut()
        .unwrap()
        .retain(|s| !(30.5..40.0).contains(&s.time_s));
    let track = FusedTrack::new(&sensors, &config()).unwrap();
    assert!(track.motion(19.0, 19.5).is_some());
    assert!(track.motion(19.5, 20.5).is_none() && track.speed_at(20.5).is_none());
    let parts = track.parts(30.1, 30.4).unwrap();
    assert!(parts.steering_yaw_rad.is_none() && parts.imu_yaw_rad.is_some());
    // The only sensor present is used, without the error found for it elsewhere.
    let off = |from, to| {
        let yaw = track.motion(from, to).unwrap().yaw_rad;
        (yaw - exact(yaw_rate, from, to)).abs()
    };
    let by_gyro = off(30.1, 30.4);
    assert!(by_gyro < 1.5e-3, "{by_gyro} {parts:?}");
    assert!(track.motion(30.6, 30.8).is_none(), "neither measures yaw");
    let parts = track.parts(33.0, 33.5).unwrap();
    let by_steering = off(33.0, 33.5);
    assert!(by_steering < 2e-3, "{by_steering} {parts:?}");
    assert!(track.motion(50.0, 49.0).is_none() && track.motion(50.0, 50.0).is_none());
    assert!(track.motion(f64::NAN, 50.0).is_none() && track.motion(50.0, f64::NAN).is_none());
}

#[test]
fn the_accelerometer_counts_less_the_longer_it_drifts() {
    let track = FusedTrack::new(&all(), &config()).unwrap();
    let alpha = config().fusion.alpha_distance;
    for (seconds, share) in [
        (0.1, alpha),
        (1.0, alpha),
        (2.0, alpha / 4.0),
        (10.0, alpha / 100.0),
    ] {
        let (from, to) = (20.0, 20.0 + seconds);
        let parts = track.parts(from, to).unwrap();
        let (imu, vehicle) = (parts.imu_distance_m.unwrap(), parts.vehicle_distance_m);
        let fused = track.motion(from, to).unwrap().distance_m;
        let expected = share * imu + (1.0 - share) * vehicle;
        assert!(
            (fused - expected).abs() < 1e-9,
            "{seconds}: {fused} for {expected}"
        );
    }
}

#[test]
fn opposite_signs_of_steering_and_gyro_are_refused() {
    let mut turned = config();
    turned.bicycle = Some(Bicycle::new(2.7).with_steering_wheel(-15.0));
    let error = FusedTrack::new(&all(), &turned).unwrap_err();
    assert!(matches!(error, Error::YawSigns { .. }), "{error}");
    assert!(error.hint().unwrap().contains("negative"));
}

#[test]
fn a_fused_model_answers_like_its_track() {
    let track = FusedTrack::new(&all(), &config()).unwrap();
    let model = MotionModel::from(track.clone());
    assert_eq!(model.motion(20.0, 20.5), track.motion(20.0, 20.5));
    assert_eq!(model.speed_at(20.0), track.speed_at(20.0));
    assert_eq!(model.times_s().len(), 3700);
}

#[test]
fn the_configuration_is_read_from_a_file_and_errors_name_the_field() {
    for file in ["rav4_2017", "civic_2016"] {
        let path = format!("{}/examples/{file}.toml", env!("CARGO_MANIFEST_DIR"));
        let config: MotionConfig = toml::from_str(&std::fs::read_to_string(path).unwrap()).unwrap();
        assert_eq!(
            config.fusion,
            FusionConfig {
                alpha_distance: 0.1,
                alpha_yaw: 0.9
            }
        );
        config.bicycle.unwrap().validate().unwrap();
        let mount = config.imu.vehicle_from_imu.se3();
        assert!((mount.rotate(&Vector3::z()) + Vector3::z()).norm() < 1e-12);
    }
    let mut bad = config();
    bad.fusion.alpha_yaw = 1.5;
    let error = FusedTrack::new(&all(), &bad).unwrap_err();
    assert!(error.to_string().contains("alpha_yaw is 1.5"), "{error}");
    assert!(toml::from_str::<MotionConfig>("[fusion]\nalpha = 0.5").is_err());
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(64))]
    /// Whatever a recorder writes, the result is a finite motion, `None`, or an error.
    #[test]
    fn any_input_gives_neither_nan_nor_panic(
        times in proptest::collection::vec(prop_oneof![8 => 0.0..5.0f64, 1 => any::<f64>()], 0..80),
        values in proptest::collection::vec(prop_oneof![8 => -20.0..20.0f64, 1 => any::<f64>()], 80),
        sorted in any::<bool>(), from in -1.0..6.0f64, dt in -0.5..1.0f64,
    ) {
        let mut times = times;
        if sorted { times.sort_by(f64::total_cmp); }
        let pairs = || times.iter().copied().zip(values.iter().copied());
        let sensors = VehicleSensors {
            speed_mps: Signal::new(pairs()),
            steering_rad: Some(Signal::new(pairs().map(|(t, v)| (t, v * 0.1)))),
            imu: Some(pairs().map(|(time_s, v)| ImuSample {
                time_s,
                acceleration_mps2: Vector3::new(v * 0.1, 0.0, 9.8),
                angular_rate_radps: Vector3::new(0.0, v * 0.01, v),
            }).collect()),
        };
        let motion = FusedTrack::new(&sensors, &config()).ok().and_then(|t| t.motion(from, from + dt));
        if let Some(motion) = motion {
                prop_assert!(motion.distance_m.is_finite() && motion.yaw_rad.is_finite());
        }
    }
}
