//! Wheelbase and steering ratio identified from drives with known parameters.

use deepfusion_hint::Hint;
use deepfusion_motion::{
    Bicycle, IdentifyConfig, Signal, Unidentifiable, UnidentifiableReason, identify,
};
use proptest::prelude::*;

/// The streams of a drive: speed and steering at 50 Hz, a gyro at 100 Hz with noise and bias.
struct Drive {
    speed: Signal,
    steering: Signal,
    yaw_rate: Signal,
}

const BIAS: f64 = 0.003;

/// Noise that repeats from run to run: about normal, standard deviation 1.
fn noise(i: usize, salt: u64) -> f64 {
    let uniform = |k: u64| {
        let mut z = (i as u64 * 12 + k + salt * 1_000_003).wrapping_mul(0x9e37_79b9_7f4a_7c15);
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        (z >> 11) as f64 / (1u64 << 53) as f64
    };
    (0..12).map(uniform).sum::<f64>() - 6.0
}

impl Drive {
    /// A drive in which `steer` is the road wheels' angle over time and `speed` the car's speed.
    fn new(
        car: &Bicycle,
        seconds: f64,
        speed: impl Fn(f64) -> f64,
        steer: impl Fn(f64) -> f64,
    ) -> Self {
        let wheel = |t: f64| car.steering_ratio * steer(t) + car.steering_offset_rad;
        // Quantised as in cars: 0.01 km/h and 0.1°.
        let step = |value: f64, step: f64| (value / step).round() * step;
        let slow = (0..(seconds * 50.0) as usize).map(|i| i as f64 * 0.02);
        let fast = (0..(seconds * 100.0) as usize).map(|i| (i, i as f64 * 0.01));
        Self {
            speed: Signal::new(slow.clone().map(|t| (t, step(speed(t), 0.01 / 3.6)))),
            steering: Signal::new(slow.map(|t| (t, step(wheel(t), 0.1_f64.to_radians())))),
            yaw_rate: Signal::new(fast.map(|(i, t)| {
                let true_rate = car.yaw_rate(speed(t), wheel(t));
                (t, true_rate + BIAS + 0.005 * noise(i, 7))
            })),
        }
    }

    fn identify(
        &self,
        config: &IdentifyConfig,
    ) -> Result<deepfusion_motion::Identified, Unidentifiable> {
        identify(&self.speed, &self.steering, &self.yaw_rate, config)
    }
}

fn car() -> Bicycle {
    Bicycle {
        steering_offset_rad: 0.03,
        ..Bicycle::new(2.7).with_steering_wheel(15.4)
    }
}

/// Two minutes around a car park: to the lock and back, 1 to 3 m/s.
fn parking(car: &Bicycle) -> Drive {
    Drive::new(
        car,
        120.0,
        |t| 2.0 + (0.21 * t).sin(),
        |t| 0.55 * (0.5 * t).sin() * (0.13 * t).cos(),
    )
}

/// Two minutes on roads: bends of up to 0.06 rad, 5 to 15 m/s.
fn road(car: &Bicycle) -> Drive {
    Drive::new(
        car,
        120.0,
        |t| 10.0 + 5.0 * (0.11 * t).sin(),
        |t| 0.06 * (0.4 * t).sin(),
    )
}

#[test]
fn parking_shows_wheelbase_and_ratio() {
    let car = car();
    let found = parking(&car).identify(&IdentifyConfig::default()).unwrap();
    eprintln!("{found:?}");
    let near = |estimate: deepfusion_motion::Estimate, truth: f64, share: f64| {
        let error = (estimate.value - truth).abs();
        assert!(error < share * truth.abs(), "{estimate:?}, {truth}");
        assert!(error < 4.0 * estimate.std_error, "{estimate:?}, {truth}");
    };
    near(found.wheelbase_m, 2.7, 0.03);
    near(found.steering_ratio, 15.4, 0.03);
    near(found.product_m, 2.7 * 15.4, 0.01);
    near(found.yaw_rate_bias_radps, BIAS, 0.3);
    assert!(
        (found.steering_offset_rad.value - 0.03).abs() < 0.01,
        "{found:?}"
    );
    assert!(found.product_m.relative_error() < found.wheelbase_m.relative_error());
}

#[test]
fn a_road_shows_only_the_product_and_one_when_the_other_is_known() {
    let drive = road(&car());
    let error = drive.identify(&IdentifyConfig::default()).unwrap_err();
    assert_eq!(error.why, UnidentifiableReason::OnlyTheProduct, "{error}");
    let product = error.product_m.unwrap();
    assert!(
        (product.value / (2.7 * 15.4) - 1.0).abs() < 0.01,
        "{product:?}"
    );
    assert!(error.hint().unwrap().contains("give one"));

    let ratio_known = IdentifyConfig {
        steering_ratio: Some(15.4),
        ..IdentifyConfig::default()
    };
    let found = drive.identify(&ratio_known).unwrap();
    assert!(
        (found.wheelbase_m.value / 2.7 - 1.0).abs() < 0.01,
        "{found:?}"
    );
    assert_eq!(found.steering_ratio.std_error, 0.0);

    let wheelbase_known = IdentifyConfig {
        wheelbase_m: Some(2.7),
        ..IdentifyConfig::default()
    };
    let found = drive.identify(&wheelbase_known).unwrap();
    assert!(
        (found.steering_ratio.value / 15.4 - 1.0).abs() < 0.01,
        "{found:?}"
    );
    assert_eq!(found.wheelbase_m.std_error, 0.0);
    let steering = found.bicycle(0.0);
    assert!((steering.yaw_rate(10.0, 0.5) - car().yaw_rate(10.0, 0.5)).abs() < 2e-3);
}

#[test]
fn a_straight_drive_shows_nothing() {
    let drive = Drive::new(&car(), 120.0, |_| 15.0, |t| 0.001 * t.sin());
    let error = drive.identify(&IdentifyConfig::default()).unwrap_err();
    assert_eq!(error.why, UnidentifiableReason::Straight, "{error}");
    assert!(error.figure < 5.0 && error.to_string().contains("straight"));
}

#[test]
fn a_steering_that_counts_to_the_right_has_a_negative_ratio() {
    let found = parking(&Bicycle::new(2.7).with_steering_wheel(-15.4));
    let found = found.identify(&IdentifyConfig::default()).unwrap();
    assert!(
        (found.steering_ratio.value / -15.4 - 1.0).abs() < 0.03,
        "{found:?}"
    );
}

#[test]
fn outliers_do_not_move_the_fit() {
    let mut drive = parking(&car());
    let times = drive.yaw_rate.times_s().to_vec();
    let wild = times.iter().zip(drive.yaw_rate.values()).enumerate();
    let wild = wild.map(|(i, (t, w))| (*t, if i % 600 < 40 { w + 1.5 } else { *w }));
    drive.yaw_rate = Signal::new(wild);
    let found = drive.identify(&IdentifyConfig::default()).unwrap();
    assert!(
        (found.wheelbase_m.value / 2.7 - 1.0).abs() < 0.03,
        "{found:?}"
    );
}

#[test]
fn at_constant_speed_the_product_is_known_but_zero_and_bias_are_not_separated() {
    let drive = Drive::new(&car(), 120.0, |_| 10.0, |t| 0.06 * (0.4 * t).sin());
    let config = IdentifyConfig {
        steering_ratio: Some(15.4),
        ..IdentifyConfig::default()
    };
    let found = drive.identify(&config).unwrap();
    assert!(
        (found.wheelbase_m.value / 2.7 - 1.0).abs() < 0.02,
        "{found:?}"
    );
    assert!(found.yaw_rate_bias_radps.std_error > 0.01, "{found:?}");
}

#[test]
fn a_yaw_rate_that_does_not_follow_the_steering_is_refused() {
    let mut drive = road(&car());
    drive.yaw_rate =
        Signal::new((0..12_000).map(|i| (f64::from(i) * 0.01, 0.2 * noise(i as usize / 50, 3))));
    let error = drive.identify(&IdentifyConfig::default()).unwrap_err();
    assert_eq!(error.why, UnidentifiableReason::TooUncertain, "{error}");
    let empty = Signal::default();
    assert!(identify(&empty, &empty, &empty, &IdentifyConfig::default()).is_err());
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(12))]
    /// Any car's parking is identified within 3 %, or declared unidentifiable.
    #[test]
    fn any_car_is_identified_or_declared_unidentifiable(wheelbase in 2.3..3.6f64, ratio in 12.0..20.0f64, offset in -0.2..0.2f64) {
        let car = Bicycle { steering_offset_rad: offset, ..Bicycle::new(wheelbase).with_steering_wheel(ratio) };
        if let Ok(found) = parking(&car).identify(&IdentifyConfig { largest_relative_error: 0.01, ..IdentifyConfig::default() }) {
            prop_assert!((found.wheelbase_m.value / wheelbase - 1.0).abs() < 0.03, "{found:?}");
            prop_assert!((found.steering_ratio.value / ratio - 1.0).abs() < 0.03, "{found:?}");
        }
    }
}
