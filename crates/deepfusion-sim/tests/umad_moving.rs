//! Dynamic points of a bag: velocities at pixels, and the topic of dynamic points.

use deepfusion_data::{Dataset, GtKind, MovingSource, OpenOptions};
use deepfusion_hint::Hint;
use deepfusion_rosbag::Compression;
use deepfusion_sim::{BagSettings, Scene, Sensors, SimConfig, Simulation, topic, write_bag};
use nalgebra::Vector3;
use std::ops::ControlFlow;
use std::path::{Path, PathBuf};

const FRAMES: usize = 60;
/// Every fifth frame is taken at the time of a scan: frames come at 25 Hz, scans at 10 Hz.
const SCANNED: usize = 5;

fn simulation() -> Simulation {
    let config = SimConfig {
        seed: 21,
        frames: FRAMES,
        width: 160,
        height: 120,
        fps: 25.0,
        moving_cars: 10,
        scene: Scene::Urban,
        sensors: Sensors::Umad,
        scan_every: 0,
        ..SimConfig::default()
    };
    Simulation::new(&config).unwrap()
}

fn bag(simulation: &Simulation, folder: &Path) -> PathBuf {
    let settings = BagSettings {
        compression: Compression::None,
        ..BagSettings::default()
    };
    write_bag(simulation, &folder.join("bag"), &settings, &mut |_, _| {
        ControlFlow::Continue(())
    })
    .unwrap()
}

fn try_open(path: &Path) -> deepfusion_data::Result<Dataset> {
    let mut all = Dataset::open(path, &OpenOptions::default())?;
    assert_eq!(all.len(), 1);
    Ok(all.remove(0))
}

fn open(path: &Path) -> Dataset {
    try_open(path).unwrap()
}

/// Rewrites the file beside a bag.
fn describe(bag: &Path, change: impl Fn(String) -> String) {
    let sidecar = bag.with_extension("toml");
    let text = std::fs::read_to_string(&sidecar).unwrap();
    std::fs::write(&sidecar, change(text)).unwrap();
}

/// Renames the velocity field of the clouds to an unknown name, so that the LiDAR has no velocities.
fn without_velocities(bag: &Path) {
    let bytes = std::fs::read(bag).unwrap();
    let (field, other) = (b"\x08\0\0\0velocity", b"\x08\0\0\0reserved");
    let mut changed = bytes.clone();
    for at in 0..bytes.len() - field.len() {
        if bytes[at..].starts_with(field) {
            changed[at..at + field.len()].copy_from_slice(other);
        }
    }
    assert!(changed != bytes);
    std::fs::write(bag, changed).unwrap();
    describe(bag, |text| {
        text.replace("velocity_field = \"velocity\"\n", "")
    });
}

/// Which pixels with a depth are dynamic, in the frames that have a scan.
fn moving(set: &Dataset) -> Vec<Vec<bool>> {
    let labels = set.moving_labels().unwrap().unwrap();
    let of_frame = |frame: usize| {
        let truth = set.ground_truth(frame, GtKind::Z).unwrap().unwrap();
        let moving = labels.pixels(frame as u64, &truth, GtKind::Z).unwrap();
        moving.unwrap()
    };
    (0..FRAMES).step_by(SCANNED).map(of_frame).collect()
}

fn count(moving: &[Vec<bool>]) -> usize {
    moving.iter().flatten().filter(|m| **m).count()
}

#[test]
fn a_pixel_has_the_velocity_of_its_surface() {
    let simulation = simulation();
    let folder = tempfile::tempdir().unwrap();
    let set = open(&bag(&simulation, folder.path()));
    let k = simulation.intrinsics();
    let (width, height) = (k.width as usize, k.height as usize);
    let (mut all, mut off, mut driving) = (0, 0, 0);
    let (mut standing, mut square) = (0, 0.0);
    for frame in (0..FRAMES).step_by(SCANNED) {
        let truth = set.scan_truth(frame, GtKind::Z).unwrap().unwrap();
        assert_eq!(
            Some(&truth.depth),
            set.ground_truth(frame, GtKind::Z).unwrap().as_ref()
        );
        let velocity = truth.velocity_mps.unwrap();
        // The simulator's own points projected by its own camera, the nearest in each pixel.
        let scan = simulation.fmcw(simulation.time_s(frame));
        let cam_from_lidar =
            simulation.world_from_cam(frame).inverse() * simulation.world_from_velo(frame);
        let mut exact = vec![(f64::INFINITY, f32::NAN); width * height];
        for (point, speed) in scan.cloud.xyz.iter().zip(&scan.ground_radial_mps) {
            let seen = cam_from_lidar.transform(&Vector3::from(point.map(f64::from)));
            let Some(pixel) = k.project(&seen) else {
                continue;
            };
            let (u, v) = (pixel.x.round(), pixel.y.round());
            if (0.0..width as f64).contains(&u) && (0.0..height as f64).contains(&v) {
                let best = &mut exact[v as usize * width + u as usize];
                if seen.z < best.0 {
                    *best = (seen.z, *speed);
                }
            }
        }
        assert_eq!(velocity.len(), width * height);
        for (i, measured) in velocity.iter().enumerate() {
            assert_eq!(measured.is_nan(), truth.depth.data[i] == 0.0, "{frame} {i}");
            let exact = exact[i].1;
            if measured.is_nan() || exact.is_nan() {
                continue;
            }
            all += 1;
            // Five standard deviations of the noise, plus the error of the sensor's own velocity, which is estimated from the scan.
            off += usize::from((measured - exact).abs() > 0.3);
            driving += usize::from(exact.abs() > 1.0);
            if exact == 0.0 {
                (standing, square) = (standing + 1, square + f64::from(measured * measured));
            }
        }
    }
    let rms = (square / f64::from(standing)).sqrt();
    println!("{all} pixels, {off} off, {driving} driving, {standing} standing: rms {rms:.4} m/s");
    assert!(all > 20_000 && driving > 200, "{all} {driving}");
    // At an edge, a pixel can contain another point, because the poses in the file beside the bag are rounded.
    assert!(off * 500 < all, "{off} of {all}");
    assert!((0.02..0.12).contains(&rms), "{rms}");
}

#[test]
fn without_velocities_the_topic_of_dynamic_points_decides() {
    let simulation = simulation();
    let folder = tempfile::tempdir().unwrap();
    let path = bag(&simulation, folder.path());
    let by_velocity = open(&path);
    let labels = by_velocity.moving_labels().unwrap().unwrap();
    assert_eq!(labels.source(), MovingSource::RadialVelocity);
    let fast = moving(&by_velocity);

    without_velocities(&path);
    let set = open(&path);
    let labels = set.moving_labels().unwrap().unwrap();
    assert_eq!(labels.source(), MovingSource::DynamicPoints);
    let truth = set.scan_truth(0, GtKind::Z).unwrap().unwrap();
    assert!(truth.velocity_mps.is_none() && truth.depth.count() > 1000);
    let listed = moving(&set);
    let both = fast.iter().flatten().zip(listed.iter().flatten());
    let both = both.filter(|(a, b)| **a && **b).count();
    println!(
        "{} fast, {} listed, {both} both",
        count(&fast),
        count(&listed)
    );
    assert!(both > 200, "{both}");
    // Both thresholds are the same; they differ only by the noise.
    assert!(20 * both > 19 * count(&listed).max(count(&fast)), "{both}");
}

#[test]
fn the_topic_of_dynamic_points_agrees_with_the_velocities() {
    let folder = tempfile::tempdir().unwrap();
    let path = bag(&simulation(), folder.path());
    let agreement = open(&path).dynamic_agreement(100).unwrap().unwrap();
    println!("{agreement:?}");
    assert_eq!(agreement.scans, 24);
    assert!(agreement.listed > 2000);
    assert_eq!(agreement.in_scan, agreement.listed);
    assert!(agreement.precision() > 0.95, "{agreement:?}");
    assert!(agreement.recall() > 0.9, "{agreement:?}");
    assert_eq!(open(&path).dynamic_agreement(5).unwrap().unwrap().scans, 5);

    // If the sensor's own velocity is not subtracted, all points are dynamic.
    describe(&path, |text| {
        text.replace("[lidar]\n", "[lidar]\nover_ground = true\n")
    });
    let wrong = open(&path).dynamic_agreement(100).unwrap().unwrap();
    assert!(wrong.recall() < 0.3, "{wrong:?}");

    without_velocities(&path);
    assert!(open(&path).dynamic_agreement(100).unwrap().is_none());
}

#[test]
fn a_wrong_topic_of_dynamic_points_is_an_error() {
    let folder = tempfile::tempdir().unwrap();
    let path = bag(&simulation(), folder.path());
    let plain = std::fs::read_to_string(path.with_extension("toml")).unwrap();
    let name = |dynamic: &str| {
        describe(&path, |_| {
            format!("{plain}\n[topics]\ndynamic = \"{dynamic}\"\n")
        });
        try_open(&path)
    };
    for (topic, problem) in [
        ("/no/such/topic", "no topic /no/such/topic"),
        (topic::IMU, "wrong type sensor_msgs/Imu"),
    ] {
        let error = name(topic).unwrap_err();
        assert!(error.to_string().contains(problem), "{error}");
        assert!(error.to_string().contains(".bag"), "{error}");
        let hint = error.hint().unwrap();
        assert!(hint.contains("topics.dynamic"), "{hint}");
        assert!(hint.contains("urban_0021.toml"), "{hint}");
    }
    let set = name(topic::DYNAMIC).unwrap();
    assert!(set.dynamic_agreement(3).unwrap().is_some());
}
