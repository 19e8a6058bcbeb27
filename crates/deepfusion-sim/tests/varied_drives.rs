//! Varied drives repeat, other seeds have other cameras, and the written calibration is that of the pictures.

use deepfusion_data::{Dataset, GtKind, OpenOptions, read_depth_png};
use deepfusion_geometry::Se3;
use deepfusion_hint::Hint;
use deepfusion_sim::{
    BagSettings, Error, Scene, SceneObject, Sensors, SimConfig, Simulation, VariedConflict,
    write_bag, write_kitti,
};
use nalgebra::{Matrix3, Vector3};
use std::collections::BTreeMap;
use std::fs;
use std::ops::ControlFlow;
use std::path::{Path, PathBuf};

/// Height of the IMU above the road, metres.
const IMU_HEIGHT: f64 = 0.93;

fn config(scene: Scene, seed: u64) -> SimConfig {
    SimConfig {
        seed,
        frames: 2,
        width: 160,
        height: 64,
        fps: 5.0,
        scene,
        scan_every: 0,
        varied: true,
        ..SimConfig::default()
    }
}

fn drive(config: &SimConfig) -> Simulation {
    Simulation::new(config).expect("a valid configuration")
}

fn open(path: &Path) -> Dataset {
    let mut all = Dataset::open(path, &OpenOptions::default()).expect("a recording");
    assert_eq!(all.len(), 1);
    all.remove(0)
}

/// The bytes of every file below a folder, by its path in the folder.
fn files(folder: &Path) -> BTreeMap<PathBuf, Vec<u8>> {
    let (mut found, mut folders) = (BTreeMap::new(), vec![folder.to_owned()]);
    while let Some(here) = folders.pop() {
        for entry in fs::read_dir(here).expect("a folder") {
            let path = entry.expect("an entry").path();
            if path.is_dir() {
                folders.push(path);
            } else {
                let name = path.strip_prefix(folder).expect("below it").to_owned();
                found.insert(name, fs::read(path).expect("a file"));
            }
        }
    }
    found
}

#[test]
fn one_seed_gives_the_same_bytes_and_another_another_camera() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let write = |name: &str, seed| {
        let simulation = drive(&config(Scene::Urban, seed));
        let out = folder.path().join(name);
        write_kitti(&simulation, &out, &mut |_, _| ControlFlow::Continue(())).expect("written");
        (simulation.drawn().expect("varied").clone(), files(&out))
    };
    let (first, again, other) = (write("first", 3), write("again", 3), write("other", 4));
    assert_eq!(first.0, again.0);
    assert!(first.1 == again.1, "the bytes differ");
    let json = first.1.keys().filter(|name| name.ends_with("varied.json"));
    assert_eq!(json.count(), 1);
    let (a, b) = (first.0.camera, other.0.camera);
    assert_ne!(a.intrinsics, b.intrinsics);
    assert_ne!(a.height_m, b.height_m);
    assert_ne!(a.pitch_degrees, b.pitch_degrees);
    assert_ne!(first.0.light, other.0.light);
    assert_ne!(first.0.world, other.0.world);
}

#[test]
fn a_plain_drive_draws_nothing() {
    let plain = SimConfig {
        varied: false,
        moving_cars: 5,
        ..config(Scene::Urban, 3)
    };
    let folder = tempfile::tempdir().expect("a temporary folder");
    let simulation = drive(&plain);
    assert!(simulation.drawn().is_none());
    assert_eq!(simulation.moving_cars(), 5);
    write_kitti(&simulation, folder.path(), &mut |_, _| {
        ControlFlow::Continue(())
    })
    .expect("written");
    let written = files(folder.path());
    assert!(written.keys().all(|name| !name.ends_with("varied.json")));
}

/// The numbers of a line of KITTI's calibration files.
fn numbers(text: &str, key: &str) -> Vec<f64> {
    let line = text
        .lines()
        .find_map(|line| line.strip_prefix(key)?.strip_prefix(": "));
    let words = line.expect("a line of this key").split(' ');
    words.map(|word| word.parse().expect("a number")).collect()
}

/// Camera 2 from the IMU by KITTI's calibration files in a folder.
fn cam_from_imu(date: &Path) -> Se3 {
    let read = |name: &str| fs::read_to_string(date.join(name)).expect("a calibration file");
    let rigid = |name: &str| {
        let text = read(name);
        let rotation = Matrix3::from_row_slice(&numbers(&text, "R"));
        Se3::from_parts(&rotation, Vector3::from_row_slice(&numbers(&text, "T")))
    };
    let projection = numbers(&read("calib_cam_to_cam.txt"), "P_rect_02");
    let aside = Vector3::new(projection[3] / projection[0], 0.0, 0.0);
    let cam2_from_cam0 = Se3::from_axis_angle(Vector3::zeros(), aside);
    cam2_from_cam0 * rigid("calib_velo_to_cam.txt") * rigid("calib_imu_to_velo.txt")
}

/// Below the horizon no point is farther than the road's plane, as seen by the written camera; pixels of the road are on it. The tolerance
/// is half a step of a depth file, and the rounding of single precision for nearly parallel rays.
#[test]
fn the_road_lies_where_the_written_camera_sees_it() {
    for (scene, seed) in [(Scene::Urban, 1), (Scene::Country, 2), (Scene::Garage, 3)] {
        let folder = tempfile::tempdir().expect("a temporary folder");
        let simulation = drive(&config(scene, seed));
        let path = write_kitti(&simulation, folder.path(), &mut |_, _| {
            ControlFlow::Continue(())
        })
        .expect("written");
        let bytes = fs::read(path.join("varied.json")).expect("what was drawn");
        let json: serde_json::Value = serde_json::from_slice(&bytes).expect("JSON");
        let of = |key: &str| json["camera"][key].as_f64().expect("a number");
        let k = open(folder.path()).intrinsics(0);
        let drawn = simulation.drawn().expect("varied").camera.intrinsics;
        for (a, b) in [
            (k.fx, drawn.fx),
            (k.fy, drawn.fy),
            (k.cx, drawn.cx),
            (k.cy, drawn.cy),
        ] {
            assert!((a - b).abs() < 1e-8, "{a} {b}");
        }

        // The mount, for a car that stands level.
        let imu_from_cam = cam_from_imu(path.parent().expect("the date")).inverse();
        let above = imu_from_cam.translation().z + IMU_HEIGHT;
        assert!((above - of("height_m")).abs() < 1e-6, "{above}");
        let down = -imu_from_cam.rotate(&Vector3::z()).z.asin().to_degrees();
        assert!((down - of("pitch_degrees")).abs() < 1e-6, "{down}");
        let right = imu_from_cam.rotate(&Vector3::x());
        let clockwise = (-right.z / down.to_radians().cos()).asin().to_degrees();
        assert!((clockwise - of("roll_degrees")).abs() < 1e-6, "{clockwise}");

        // The road at z = 0, seen from the car as it moves on its springs.
        let world_from_cam = simulation.world_from_imu(1) * imu_from_cam;
        let eye = world_from_cam.translation();
        assert!((eye.z - of("height_m")).abs() < 0.06, "{}", eye.z);
        let depth = path.join("proj_depth/groundtruth/image_02/0000000001.png");
        let depth = read_depth_png(&depth).expect("the depth");
        let (mut below, mut road) = (0, 0);
        for v in 0..k.height {
            for u in 0..k.width {
                let ray = k.back_project(f64::from(u), f64::from(v), 1.0);
                let plane = -eye.z / world_from_cam.rotate(&ray).z;
                if !(0.0..60.0).contains(&plane) {
                    continue;
                }
                let found = depth.get(u as usize, v as usize).map_or(0.0, f64::from);
                let tolerance = 0.003 + 2e-4 * plane;
                assert!(found > 0.0, "sky below the horizon: {u}, {v}");
                assert!(found < plane + tolerance, "{u}, {v}: {found} {plane}");
                below += 1;
                road += usize::from(found > plane - tolerance);
            }
        }
        println!("{}: {road} of {below} pixels are road", scene.name());
        assert!(below > 100 && 20 * road > below, "{road} of {below}");
    }
}

/// The camera's motion from OXTS and the calibration is the true motion of the drawn camera.
#[test]
fn the_reader_s_motion_is_the_drawn_camera_s() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let simulation = drive(&SimConfig {
        frames: 4,
        width: 64,
        height: 32,
        fps: 10.0,
        ..config(Scene::Urban, 5)
    });
    write_kitti(&simulation, folder.path(), &mut |_, _| {
        ControlFlow::Continue(())
    })
    .expect("written");
    let snippets = open(folder.path()).snippets(&[1], 0.5).expect("pairs");
    assert!(!snippets.is_empty());
    for snippet in &snippets {
        let motion = &snippet.sources[0].motion;
        let (target, source) = (snippet.target, snippet.sources[0].frame);
        let truth = simulation.world_from_cam(source).inverse() * simulation.world_from_cam(target);
        let distance = truth.translation().norm();
        let error = motion.source_from_target.expect("oxts has yaw rates") * truth.inverse();
        assert!(error.angle() < 0.008, "{}", error.angle());
        let off = error.translation().norm();
        assert!(off < 0.02 * distance + 0.02, "{off} of {distance}");
    }
}

/// A bag's camera, and the mount in the file beside it: the points of its LiDAR agree with the exact depth.
#[test]
fn a_bag_has_the_drawn_camera_and_its_mount() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let simulation = drive(&SimConfig {
        frames: 11,
        width: 160,
        height: 120,
        fps: 25.0,
        sensors: Sensors::Umad,
        ..config(Scene::Urban, 21)
    });
    let path = write_bag(
        &simulation,
        &folder.path().join("bag"),
        &BagSettings::default(),
        &mut |_, _| ControlFlow::Continue(()),
    )
    .expect("written");
    let text = fs::read_to_string(path.with_extension("varied.json")).expect("what was drawn");
    assert!(text.contains("\"weather\"") && text.contains("\"jpeg_quality\""));
    let set = open(&path);
    let (k, drawn) = (set.intrinsics(0), simulation.intrinsics());
    assert_eq!(
        (k.fx, k.fy, k.cx, k.cy),
        (drawn.fx, drawn.fy, drawn.cx, drawn.cy)
    );
    let truth = set.ground_truth(0, GtKind::Z).expect("readable");
    let truth = truth.expect("the first frame has a scan");
    let exact = simulation.frame(0).depth;
    // Errors in rows of pixels, for a road seen from the camera's height: half a pixel of rounding at any height.
    let rows = k.fy
        * simulation
            .drawn()
            .expect("varied")
            .camera
            .height_m
            .expect("drawn");
    let both = truth.data.iter().zip(&exact.data);
    let both = both.filter(|(ours, exact)| **ours > 0.0 && **exact > 0.0);
    let off = |ours: f32, exact: f32| rows as f32 * (1.0 / ours - 1.0 / exact).abs();
    let mut errors: Vec<f32> = both.map(|(ours, exact)| off(*ours, *exact)).collect();
    errors.sort_by(f32::total_cmp);
    assert!(errors.len() > 100, "{}", errors.len());
    let median = errors[errors.len() / 2];
    assert!(median < 0.75, "{median}");
}

/// No car appears or disappears within sight, although varied streets are too narrow for some.
#[test]
fn no_car_disappears_ahead_of_the_camera() {
    let mut met = 0;
    for seed in 1..4 {
        let simulation = drive(&SimConfig {
            frames: 24,
            moving_cars: 9,
            ..config(Scene::Urban, seed)
        });
        let standing = simulation.objects(0).into_iter();
        let standing = standing.filter(|o| o.velocity.norm() == 0.0).count() as u64;
        let kept = simulation.moving_cars() as u64;
        assert!(kept <= 9, "{kept}");
        let seen = |frame: usize| -> BTreeMap<u64, Vector3<f64>> {
            let cam_from_world = simulation.world_from_cam(frame).inverse();
            let moving = simulation.objects(frame).into_iter();
            let moving = moving.filter(|object| object.id >= standing);
            let place = |object: &SceneObject| {
                cam_from_world.transform(&object.world_from_object.translation())
            };
            moving.map(|object| (object.id, place(&object))).collect()
        };
        for frame in 1..24 {
            let (before, now) = (seen(frame - 1), seen(frame));
            let near = |p: &Vector3<f64>| p.z > 3.0 && p.norm() < 60.0;
            for (id, place) in before.iter().filter(|(_, place)| near(place)) {
                met += 1;
                assert!(*id < standing + kept, "{seed}: {id}, {standing} stand");
                assert!(now.contains_key(id), "{seed}, {frame}: {id} at {place}");
            }
            for (id, place) in now.iter().filter(|(_, place)| near(place)) {
                assert!(before.contains_key(id), "{seed}, {frame}: {id} at {place}");
            }
        }
    }
    println!("{met} cars in frames");
    assert!(met > 20, "only {met} cars in frames");
}

#[test]
fn settings_that_a_varied_drive_cannot_have_are_refused() {
    let varied = || config(Scene::Urban, 1);
    let bad = [
        (
            SimConfig {
                camera_height_m: 1.2,
                ..varied()
            },
            VariedConflict::CameraHeight,
        ),
        (
            SimConfig {
                stereo_baseline_m: 0.53,
                ..varied()
            },
            VariedConflict::SecondCamera,
        ),
        (config(Scene::Indoor, 1), VariedConflict::Rooms),
        (
            SimConfig {
                varied: false,
                ..config(Scene::Motorway, 1)
            },
            VariedConflict::OnlyVaried,
        ),
    ];
    for (config, expected) in bad {
        let error = Simulation::new(&config).err().expect("refused");
        assert!(
            matches!(&error, Error::Varied { why, .. } if *why == expected),
            "{error}"
        );
        assert!(error.to_string().contains(expected.setting()), "{error}");
        assert!(error.hint().is_some());
    }
}
