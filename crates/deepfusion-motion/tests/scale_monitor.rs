//! The monitor on simulated drives whose images are zoomed during the drive.

use deepfusion_geometry::Se3;
use deepfusion_motion::{
    GreyImage, GroundPair, RoadTexture, ScaleMonitor, ScaleMonitorConfig, ScaleReading, ScaleState,
};
use deepfusion_sim::{SimConfig, Simulation};
use nalgebra::Vector3;
use std::sync::Arc;

/// Width of the images, pixels.
const WIDTH: u32 = 320;
/// Number of frames before and after the zoom begins.
const FRAMES: [usize; 2] = [102, 100];
/// Height of the simulator's camera, in metres; a moving car pitches.
const HEIGHT_M: f64 = 1.65;

struct Drive {
    images: Vec<GreyImage>,
    simulation: Simulation,
}

fn drive(seed: u64) -> Drive {
    let simulation = Simulation::new(&SimConfig {
        seed,
        frames: FRAMES[0] + FRAMES[1],
        width: WIDTH,
        height: 96,
        moving_cars: 4,
        ..SimConfig::default()
    })
    .unwrap();
    let grey = |frame: usize| {
        let rgb = simulation.frame(frame).rgb;
        let luma = |p: &image::Rgb<u8>| {
            0.299 * f32::from(p[0]) + 0.587 * f32::from(p[1]) + 0.114 * f32::from(p[2])
        };
        GreyImage {
            width: WIDTH as usize,
            height: 96,
            data: rgb.pixels().map(luma).collect(),
        }
    };
    Drive {
        images: (0..simulation.frames()).map(grey).collect(),
        simulation,
    }
}

/// The image enlarged about its centre.
fn zoomed(image: &GreyImage, zoom: f64) -> GreyImage {
    let middle = [image.width, image.height].map(|s| (s as f64 - 1.0) / 2.0);
    let data = (0..image.height)
        .flat_map(|y| (0..image.width).map(move |x| [x, y]))
        .map(|p| {
            let [x, y] = [0, 1].map(|i| middle[i] + (p[i] as f64 - middle[i]) / zoom);
            image.sample(x as f32, y as f32)
        })
        .collect();
    GreyImage { data, ..*image }
}

/// The readings after each frame. From the second stretch on, the images are zoomed and the reported speed is too high by these factors.
fn readings(drive: &Drive, zoom: f64, speed: f64, config: ScaleMonitorConfig) -> Vec<ScaleReading> {
    let mut monitor = ScaleMonitor::new(config);
    let images: Vec<Arc<RoadTexture>> = drive
        .images
        .iter()
        .enumerate()
        .map(|(i, image)| {
            let seen = if i < FRAMES[0] {
                image.clone()
            } else {
                zoomed(image, zoom)
            };
            Arc::new(RoadTexture::from(&seen))
        })
        .collect();
    (1..images.len())
        .map(|i| {
            let at = |frame| drive.simulation.world_from_cam(frame);
            let motion = at(i - 1).inverse() * at(i);
            let motion = planar(&motion);
            let factor = if i < FRAMES[0] { 1.0 } else { speed };
            let pair = GroundPair {
                earlier: images[i - 1].clone(),
                later: images[i].clone(),
                intrinsics: drive.simulation.intrinsics(),
                seconds: 0.1,
                earlier_from_later: Se3::from_parts(
                    &motion.rotation(),
                    motion.translation() * factor,
                ),
                down_in_cam: Vector3::y(),
            };
            monitor.add(&pair, None)
        })
        .collect()
}

/// The part of a motion that a vehicle's speed and yaw rate measure: without pitch and heave.
fn planar(motion: &Se3) -> Se3 {
    let turn = Vector3::new(0.0, motion.axis_angle().y, 0.0);
    let way = motion.translation();
    Se3::from_axis_angle(turn, Vector3::new(way.x, 0.0, way.z))
}

fn alarms(readings: &[ScaleReading]) -> usize {
    readings
        .iter()
        .filter(|r| r.state == ScaleState::Drift)
        .count()
}

#[test]
fn clean_drives_are_silent_and_a_zoom_is_noticed() {
    for seed in [81, 82, 89] {
        let drive = drive(seed);
        let clean = readings(&drive, 1.0, 1.0, ScaleMonitorConfig::default());
        assert_eq!(alarms(&clean), 0, "{seed}");
        let last = clean.last().unwrap();
        assert_eq!(last.state, ScaleState::Steady, "{seed}: {last:?}");
        assert!((last.ratio.unwrap() - 1.0).abs() < 0.04, "{seed}: {last:?}");
        assert!(
            (last.height_m.unwrap() / HEIGHT_M - 1.0).abs() < 0.06,
            "{seed}: {last:?}"
        );
        // The reference was learned before the zoom.
        assert_eq!(clean[FRAMES[0] - 3].state, ScaleState::Learning);

        let zoomed = readings(&drive, 1.1, 1.0, ScaleMonitorConfig::default());
        let last = zoomed.last().unwrap();
        assert_eq!(last.state, ScaleState::Drift, "{seed}: {last:?}");
        let [low, high] = last.ci95.unwrap();
        assert!(low < 1.1 && high > 1.03, "{seed}: {last:?}");

        let fast = readings(&drive, 1.0, 0.9, ScaleMonitorConfig::default());
        let last = fast.last().unwrap();
        assert_eq!(last.state, ScaleState::Drift, "{seed}: {last:?}");
        assert!(last.ratio.unwrap() < 0.95, "{seed}: {last:?}");
    }
}

/// Speeds in another unit, and another resolution, lead to heights outside those tried around the usual one.
#[test]
fn a_change_beyond_the_heights_tried_is_noticed() {
    let drive = drive(81);
    for (zoom, speed, expected) in [(1.0, 3.6, 3.6), (1.6, 1.0, 1.6)] {
        let all = readings(&drive, zoom, speed, ScaleMonitorConfig::default());
        assert_eq!(alarms(&all[..FRAMES[0]]), 0);
        let last = all.last().unwrap();
        assert_eq!(last.state, ScaleState::Drift, "{expected}: {last:?}");
        let ratio = last.ratio.unwrap();
        assert!((ratio / expected).ln().abs() < 0.2, "{expected}: {last:?}");
    }
    // With a measured height, the alarm comes from the first reading on.
    let known = ScaleMonitorConfig {
        height_m: Some(HEIGHT_M),
        ..ScaleMonitorConfig::default()
    };
    let all = readings(&drive, 1.0, 3.6, known);
    let last = all.last().unwrap();
    assert_eq!(last.state, ScaleState::Drift, "{last:?}");
}

#[test]
fn a_height_that_was_measured_needs_no_learning() {
    let drive = drive(83);
    let config = ScaleMonitorConfig {
        height_m: Some(HEIGHT_M),
        ..ScaleMonitorConfig::default()
    };
    let first = readings(&drive, 1.0, 1.0, config.clone());
    let ready = first.iter().position(|r| r.ratio.is_some()).unwrap();
    assert!(ready < 60, "{ready}");
    assert!(
        (first[ready].ratio.unwrap() - 1.0).abs() < 0.06,
        "{:?}",
        first[ready]
    );
    // Half the true height: an alarm from the first reading on.
    let wrong = ScaleMonitorConfig {
        height_m: Some(0.5 * HEIGHT_M),
        ..config
    };
    let readings = readings(&drive, 1.0, 1.0, wrong);
    let first = readings.iter().find(|r| r.ratio.is_some()).unwrap();
    assert_eq!(first.state, ScaleState::Drift, "{first:?}");
}

#[test]
fn the_networks_metres_are_compared_with_the_vehicles() {
    let drive = drive(81);
    let mut monitor = ScaleMonitor::new(ScaleMonitorConfig::default());
    let mut last = None;
    let texture = |frame: usize| Arc::new(RoadTexture::from(&drive.images[frame]));
    for i in 1..FRAMES[0] {
        let at = |frame| drive.simulation.world_from_cam(frame);
        let pair = GroundPair {
            earlier: texture(i - 1),
            later: texture(i),
            intrinsics: drive.simulation.intrinsics(),
            seconds: 0.1,
            earlier_from_later: at(i - 1).inverse() * at(i),
            down_in_cam: Vector3::y(),
        };
        // A network whose road is a fifth too far below the camera; now and then it finds no road.
        let height = if i % 5 == 0 { f64::NAN } else { 1.2 * HEIGHT_M };
        last = monitor.add(&pair, Some(height)).depth_ratio;
    }
    let ratio = last.unwrap();
    assert!((ratio - 1.2).abs() < 0.06, "{ratio}");
}

#[test]
fn images_without_a_road_and_a_standing_car_give_no_reading() {
    let simulation = Simulation::new(&SimConfig {
        frames: 1,
        ..SimConfig::default()
    })
    .unwrap();
    let flat = Arc::new(RoadTexture::from(&GreyImage {
        width: 640,
        height: 192,
        data: vec![7.0; 640 * 192],
    }));
    let mut monitor = ScaleMonitor::new(ScaleMonitorConfig::default());
    for way in [0.0, 1.0, f64::NAN] {
        for _ in 0..30 {
            let pair = GroundPair {
                earlier: flat.clone(),
                later: flat.clone(),
                intrinsics: simulation.intrinsics(),
                seconds: 0.1,
                earlier_from_later: deepfusion_geometry::Se3::from_axis_angle(
                    Vector3::zeros(),
                    Vector3::new(0.0, 0.0, way),
                ),
                down_in_cam: Vector3::y(),
            };
            let reading = monitor.add(&pair, None);
            assert_eq!((reading.ratio, reading.state), (None, ScaleState::Learning));
        }
    }
}
