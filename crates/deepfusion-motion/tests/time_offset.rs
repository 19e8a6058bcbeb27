//! The clocks' offset on simulated drives, where it is known, and on KITTI, where it should be zero.

use crate::support::{kitti, real_data};
use deepfusion_hint::Hint;
use deepfusion_motion::{
    FusedTrack, GreyFrame, ImageMotion, MotionConfig, NoTimeOffset, OffsetConfig, Signal,
    TimeOffset, VehicleRates, image_motions, time_offset,
};
use deepfusion_sim::{SimConfig, Simulation};
use image::imageops;

/// The simulator's sensors run at 100 Hz; every fourth sample has an image.
const SENSOR_HZ: f64 = 100.0;
const EVERY: usize = 4;

/// OXTS values: forward speed, then roll, pitch and yaw rate.
const READINGS: [usize; 4] = [8, 17, 18, 19];

/// A drive with bends: the vehicle's readings with their times, and the image motion at 25 Hz.
struct Drive {
    readings: Vec<(f64, [f64; 4])>,
    pictures: Vec<ImageMotion>,
}

impl Drive {
    fn simulate(seed: u64, seconds: usize, moving_cars: usize) -> Self {
        let config = SimConfig {
            seed,
            frames: seconds * SENSOR_HZ as usize,
            fps: SENSOR_HZ,
            width: 160,
            height: 48,
            moving_cars,
            ..SimConfig::default()
        };
        let simulation = Simulation::new(&config).unwrap();
        let reading = |i: usize| {
            let values = simulation.oxts(i).values;
            (simulation.time_s(i), READINGS.map(|r| values[r]))
        };
        let frame = |i: usize| {
            let picture = simulation.frame(i);
            let grey = imageops::grayscale(&picture.rgb);
            GreyFrame::from_bytes(picture.time_s, 160, 48, grey.as_raw()).unwrap()
        };
        let frames: Vec<GreyFrame> = (0..simulation.frames()).step_by(EVERY).map(frame).collect();
        Self {
            readings: (0..simulation.frames()).map(reading).collect(),
            pictures: image_motions(&frames, 0.12),
        }
    }

    /// The vehicle's rates on a clock that is `offset_s` ahead of the camera's.
    fn rates(&self, offset_s: f64) -> VehicleRates {
        let signal = |i: usize| {
            let samples = self.readings.iter();
            Some(Signal::new(samples.map(|(t, r)| (t + offset_s, r[i]))))
        };
        VehicleRates {
            speed_mps: signal(0),
            roll_rate_radps: signal(1),
            pitch_rate_radps: signal(2),
            yaw_rate_radps: signal(3),
        }
    }

    fn offset(&self, rates: &VehicleRates) -> Result<TimeOffset, NoTimeOffset> {
        time_offset(&self.pictures, rates, &OffsetConfig::default())
    }
}

#[test]
fn the_offset_of_simulated_drives_is_found_within_ten_milliseconds() {
    for (seed, cars) in [(3, 0), (5, 6)] {
        let drive = Drive::simulate(seed, 24, cars);
        for offset_s in [-0.3, 0.0, 0.3] {
            let rates = drive.rates(offset_s);
            let found = drive.offset(&rates).unwrap();
            let error = found.vehicle_minus_camera_s - offset_s;
            eprintln!("seed {seed}: {error:+.4} s, {found:.4?}");
            assert!(error.abs() < 0.010, "seed {seed}, {offset_s} s: {found:?}");
            assert!(found.std_error_s < 0.015, "{found:?}");
            assert!(error.abs() < 3.0 * found.std_error_s, "{found:?}");

            // Bends alone are slow: the error is larger, and so is the estimated error.
            let bends_only = VehicleRates {
                roll_rate_radps: None,
                pitch_rate_radps: None,
                ..rates
            };
            let found = drive.offset(&bends_only).unwrap();
            let error = found.vehicle_minus_camera_s - offset_s;
            eprintln!("bends only: {error:+.4} s, {found:.4?}");
            assert!(error.abs() < 4.0 * found.std_error_s, "{found:?}");
            assert!(found.std_error_s > 0.008 && found.pitch_correlation.is_none());
        }
    }
}

/// A vehicle whose yaw rate and speed are given functions of time, and the image motion of its camera.
fn ideal(
    yaw_rate: fn(f64) -> f64,
    speed: fn(f64) -> f64,
    noise: f64,
    offset_s: f64,
) -> (Vec<ImageMotion>, VehicleRates) {
    let signal = |of: fn(f64) -> f64| {
        Some(Signal::new((0..=4000).map(|i| {
            let t = f64::from(i) * 0.01;
            (t + offset_s, of(t))
        })))
    };
    let pictures = (0..380).map(|i| {
        let (from, to) = (1.0 + f64::from(i) * 0.1, 1.0 + f64::from(i + 1) * 0.1);
        let middle = 0.5 * (from + to);
        // A simple noise that is the same in every run.
        let rough = noise * (f64::from(i * i % 97) / 48.5 - 1.0);
        ImageMotion {
            from_s: from,
            to_s: to,
            shift: 90.0 * 0.1 * (yaw_rate(middle) + rough),
            drop: rough,
            clockwise_rad: rough,
            growth: 0.1 * (speed(middle) + 20.0 * rough) / 20.0,
        }
    });
    let rates = VehicleRates {
        speed_mps: signal(speed),
        yaw_rate_radps: signal(yaw_rate),
        ..VehicleRates::default()
    };
    (pictures.collect(), rates)
}

fn winding(t: f64) -> f64 {
    0.2 * (0.9 * t).sin() + 0.1 * (2.3 * t).sin()
}

#[test]
fn a_winding_road_without_houses_gives_the_offset_to_a_millisecond() {
    for offset_s in [-0.3, 0.004, 0.3] {
        let (pictures, rates) = ideal(winding, |_| 10.0, 0.02, offset_s);
        let found = time_offset(&pictures, &rates, &OffsetConfig::default()).unwrap();
        let error = found.vehicle_minus_camera_s - offset_s;
        assert!(error.abs() < 0.002, "{error}: {found:?}");
        assert!(found.std_error_s < 0.01 && found.speed_correlation.is_none());
    }
}

#[test]
fn a_straight_drive_at_constant_speed_gives_no_offset() {
    let (pictures, rates) = ideal(|_| 0.0, |_| 10.0, 0.02, 0.0);
    let error = time_offset(&pictures, &rates, &OffsetConfig::default()).unwrap_err();
    assert_eq!(error, NoTimeOffset::NothingChanges);
    assert!(error.hint().unwrap().contains("bends"));
}

#[test]
fn unrelated_images_give_no_offset_or_a_large_error() {
    let (mut pictures, rates) = ideal(winding, |_| 10.0, 0.0, 0.0);
    for (i, picture) in pictures.iter_mut().enumerate() {
        picture.shift = (i * i * 31 % 101) as f64 / 50.0 - 1.0;
    }
    match time_offset(&pictures, &rates, &OffsetConfig::default()) {
        Ok(found) => assert!(found.std_error_s > 0.1, "{found:?}"),
        Err(error) => assert!(matches!(error, NoTimeOffset::NoPeak { .. }), "{error}"),
    }
    // A correlation with the wrong sign does not count.
    let (mut pictures, rates) = ideal(|t| 0.2 * (0.9 * t).sin(), |_| 10.0, 0.0, 0.0);
    pictures.iter_mut().for_each(|p| p.shift = -p.shift);
    let found = time_offset(
        &pictures,
        &rates,
        &OffsetConfig {
            search_s: 0.5,
            ..OffsetConfig::default()
        },
    );
    assert!(
        matches!(found, Err(NoTimeOffset::NoPeak { .. })),
        "{found:?}"
    );
}

#[test]
fn bad_input_is_refused_or_ignored() {
    let (mut pictures, rates) = ideal(winding, |_| 10.0, 0.0, 0.0);
    let none = time_offset(&pictures[..20], &rates, &OffsetConfig::default());
    assert!(
        matches!(none, Err(NoTimeOffset::TooFewPairs { pairs: 20, .. })),
        "{none:?}"
    );
    assert!(time_offset(&[], &rates, &OffsetConfig::default()).is_err());
    let nothing = VehicleRates::default();
    assert!(time_offset(&pictures, &nothing, &OffsetConfig::default()).is_err());
    let bad = OffsetConfig {
        search_s: f64::NAN,
        ..OffsetConfig::default()
    };
    assert_eq!(
        time_offset(&pictures, &rates, &bad),
        Err(NoTimeOffset::Config)
    );
    for (i, picture) in pictures.iter_mut().enumerate() {
        match i % 10 {
            3 => picture.shift = f64::NAN,
            5 => picture.to_s = picture.from_s,
            7 => picture.from_s = -picture.from_s,
            _ => {}
        }
    }
    let found = time_offset(&pictures, &rates, &OffsetConfig::default()).unwrap();
    assert!(found.vehicle_minus_camera_s.abs() < 0.005, "{found:?}");
}

/// OpenCV's features, essential matrix and rotation on the full images, correlated in the same way, give 0.055 to 0.065 s for all three
/// axes of both drives: the drives' oxts readings are late by that much.
#[test]
fn kittis_oxts_is_late_by_sixty_milliseconds() {
    for (drive, most) in [("0005", 0.006), ("0009", 0.02)] {
        let name = format!("kitti_raw/2011_09_26/2011_09_26_drive_{drive}_sync");
        let Some(path) = real_data(&name) else {
            return;
        };
        let sensors = kitti::sensors(&kitti::packets(&path));
        let vehicle = FusedTrack::new(&sensors, &MotionConfig::default()).unwrap();
        let rates = VehicleRates::from(&vehicle);
        let pictures = kitti::image_motion(&path);
        let found = time_offset(&pictures, &rates, &OffsetConfig::default()).unwrap();
        eprintln!("{drive}: {found:.4?}");
        let bends_only = VehicleRates {
            roll_rate_radps: None,
            pitch_rate_radps: None,
            ..rates
        };
        let bends = time_offset(&pictures, &bends_only, &OffsetConfig::default());
        eprintln!("bends only: {bends:.4?}");
        assert!(
            (found.vehicle_minus_camera_s - 0.06).abs() < 0.02,
            "{found:?}"
        );
        assert!(found.std_error_s < most, "{found:?}");
        assert!(found.pitch_correlation.unwrap() > 0.9, "{found:?}");
    }
}
