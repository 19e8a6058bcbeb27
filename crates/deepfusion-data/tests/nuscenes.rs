//! nuScenes scenes, written from a simulated street.

use crate::common::street::{
    check_intrinsics, check_motion, check_mount, check_path, check_truth, open, street, write,
};
use crate::common::text_of;
use deepfusion_data::{Cameras, Dataset, DatasetKind, Error, GtKind, OpenOptions, Split, inspect};
use deepfusion_geometry::Se3;
use deepfusion_hint::Hint;
use deepfusion_sim::Simulation;
use nalgebra::Vector3;
use serde_json::{Value, json};
use std::f64::consts::FRAC_PI_2;
use std::fs;
use std::path::{Path, PathBuf};

/// Time of the first image, microseconds since 1970.
const START_US: f64 = 1_532_402_927_612_460.0;
/// The transform from the velodyne's axes to the LiDAR's (x right, y forward, z up).
fn lidar_from_velo() -> Se3 {
    Se3::from_axis_angle(Vector3::new(0.0, 0.0, FRAC_PI_2), Vector3::zeros())
}

fn token(table: u32, row: usize) -> String {
    format!("{table:08x}{row:024x}")
}

fn placed(row: Value, pose: &Se3) -> Value {
    let mut row = row;
    let t = pose.translation();
    row["translation"] = json!([t.x, t.y, t.z]);
    row["rotation"] = json!(pose.quaternion());
    row
}

fn file_of(channel: &str, us: f64, ending: &str, keyframe: bool) -> String {
    let place = if keyframe { "samples" } else { "sweeps" };
    format!("{place}/{channel}/n015-2018-07-24__{channel}__{us:.0}.{ending}")
}

/// Writes the street, which has 24 frames per second, as a scene: the even frames are images (12 Hz, every sixth a keyframe), the odd ones
/// scans, which end 42 ms later. The tables also list another scene, whose files do not exist, and another camera.
fn write_scene(street: &Simulation, root: &Path) -> PathBuf {
    let tables = root.join("v1.0-mini");
    let table = |name: &str, rows: &[Value]| {
        write(
            &tables.join(name),
            serde_json::to_string_pretty(rows).unwrap(),
        );
    };
    let channels = ["CAM_FRONT", "LIDAR_TOP", "CAM_BACK"];
    let sensor = |(i, channel): (usize, &&str)| json!({"token": token(1, i), "channel": channel, "modality": "camera"});
    table(
        "sensor.json",
        &channels.iter().enumerate().map(sensor).collect::<Vec<_>>(),
    );
    let rig = street.rig();
    let k = street.intrinsics();
    let camera = rig.cam_from_imu().inverse();
    let lidar = rig.velo_from_imu.inverse() * lidar_from_velo().inverse();
    let calibrated = [(camera, true), (lidar, false), (camera, true)].into_iter().enumerate().map(|(i, (pose, is_camera))| {
        let matrix = if is_camera { json!([[k.fx, 0.0, k.cx], [0.0, k.fy, k.cy], [0, 0, 1]]) } else { json!([]) };
        placed(json!({"token": token(2, i), "sensor_token": token(1, i), "camera_intrinsic": matrix}), &pose)
    });
    table("calibrated_sensor.json", &calibrated.collect::<Vec<_>>());
    table(
        "scene.json",
        &[
            json!({"token": token(3, 0), "log_token": token(9, 0), "nbr_samples": 2, "name": "scene-0061", "description": "a street, \"by day\""}),
            json!({"token": token(3, 1), "log_token": token(9, 0), "nbr_samples": 1, "name": "scene-0103", "description": ""}),
        ],
    );
    let (mut samples, mut data, mut poses) = (Vec::new(), Vec::new(), Vec::new());
    for i in 0..street.frames() {
        let us = (START_US + street.time_s(i) * 1e6).round();
        let (channel, sensor, ending) = if i % 2 == 0 {
            ("CAM_FRONT", 0, "jpg")
        } else {
            ("LIDAR_TOP", 1, "pcd.bin")
        };
        let keyframe = (i / 2) % 6 == 0;
        let sample = i / 12;
        if i % 12 == 0 {
            samples.push(json!({"token": token(4, sample), "timestamp": us, "prev": "", "next": "", "scene_token": token(3, 0)}));
        }
        let file = file_of(channel, us, ending, keyframe);
        poses.push(placed(
            json!({"token": token(6, i), "timestamp": us as i64}),
            &street.world_from_imu(i),
        ));
        data.push(json!({
            "token": token(5, i), "sample_token": token(4, sample), "ego_pose_token": token(6, i),
            "calibrated_sensor_token": token(2, sensor), "timestamp": us as i64, "fileformat": ending,
            "is_key_frame": keyframe, "height": k.height, "width": k.width, "filename": file, "prev": "", "next": "",
        }));
        let path = root.join(file);
        fs::create_dir_all(path.parent().unwrap()).unwrap();
        if sensor == 0 {
            street.frame(i).rgb.save(&path).unwrap();
        } else {
            let cloud = street.velodyne(i);
            let point =
                |[x, y, z]: &[f32; 3]| [-y, *x, *z, 17.0, 3.0].map(f32::to_le_bytes).concat();
            fs::write(&path, cloud.xyz.iter().flat_map(point).collect::<Vec<u8>>()).unwrap();
        }
    }
    samples.push(json!({"token": token(4, 999), "timestamp": 1, "scene_token": token(3, 1)}));
    for (row, sensor, sample) in [(990, 0, 999), (991, 2, 0)] {
        poses.push(placed(
            json!({"token": token(6, row), "timestamp": 1}),
            &Se3::identity(),
        ));
        data.push(json!({
            "token": token(5, row), "sample_token": token(4, sample), "ego_pose_token": token(6, row),
            "calibrated_sensor_token": token(2, sensor), "timestamp": 1, "filename": format!("samples/elsewhere/{row}.jpg"),
        }));
    }
    // The order of rows must not matter.
    data.reverse();
    table("sample.json", &samples);
    table("sample_data.json", &data);
    table("ego_pose.json", &poses);
    tables
}

#[test]
fn a_scene_has_the_simulators_camera_motion_path_and_depth() {
    let root = tempfile::tempdir().unwrap();
    let street = street(48, 24.0);
    let tables = write_scene(&street, root.path());
    for place in [root.path(), &tables] {
        let all = open(place).unwrap();
        assert_eq!(
            (all.len(), all[0].kind(), all[0].name()),
            (1, DatasetKind::NuScenes, "scene-0061")
        );
    }
    let dataset = open(root.path()).unwrap().remove(0);
    let numbers: Vec<u64> = dataset.frames().iter().map(|f| f.number).collect();
    assert_eq!(numbers, (0..24).collect::<Vec<_>>());
    check_intrinsics(&dataset, &street);
    check_mount(&dataset, &street);
    check_motion(&dataset, &street, |i| 2 * i);
    check_path(&dataset, &street, |i| 2 * i);
    // The vehicle drives half a metre between an image and its scan.
    let way = street.world_from_cam(20).inverse() * street.world_from_cam(21);
    assert!(way.translation().norm() > 0.2);
    check_truth(&dataset, 10, &street.frame(20).depth);
    let seen = inspect(root.path()).unwrap();
    assert_eq!(seen.drives[0].scans, 24);
    assert_eq!(serde_json::to_value(&seen).unwrap()["kind"], "nuscenes");
    let scans = seen.streams.iter().find(|s| s.name == "LIDAR_TOP").unwrap();
    assert!((scans.rate_hz.unwrap() - 12.0).abs() < 0.5);
    let warnings = text_of(dataset.warnings());
    assert!(!warnings.contains("missing"), "{warnings}");
}

#[test]
fn scenes_and_frames_without_files_are_left_out() {
    let root = tempfile::tempdir().unwrap();
    write_scene(&street(16, 24.0), root.path());
    let frames = open(root.path()).unwrap()[0].frames().to_vec();
    // Only the keyframes, which can be downloaded separately: the numbers between them are left out.
    fs::remove_dir_all(root.path().join("sweeps")).unwrap();
    let keyframes = open(root.path()).unwrap().remove(0);
    let numbers: Vec<u64> = keyframes.frames().iter().map(|f| f.number).collect();
    assert_eq!(numbers, [0, 6]);
    assert_eq!(keyframes.frames()[1].time_s, frames[6].time_s);
    let warnings = text_of(keyframes.warnings());
    assert!(warnings.contains("6 of 8 images are missing"), "{warnings}");
    assert!(
        keyframes
            .ground_truth(1, GtKind::Velodyne)
            .unwrap()
            .is_some()
    );
    // A split names scenes.
    let split = root.path().join("split.txt");
    fs::write(&split, "scene-0061 6\n").unwrap();
    let options = OpenOptions {
        split: Some(Split::read(&split).unwrap()),
        ..OpenOptions::default()
    };
    assert_eq!(
        Dataset::open(root.path(), &options).unwrap()[0].selected(),
        [1]
    );
    let right = OpenOptions {
        camera: Cameras::Right,
        ..OpenOptions::default()
    };
    let error = Dataset::open(root.path(), &right).unwrap_err();
    assert!(matches!(error, Error::OneCamera { .. }), "{error}");
    fs::remove_dir_all(root.path().join("samples")).unwrap();
    let error = open(root.path()).unwrap_err();
    assert!(
        error.to_string().contains("samples/CAM_FRONT/n015"),
        "{error}"
    );
    assert!(error.hint().unwrap().contains("samples and sweeps"));
}

#[test]
fn errors_name_file_line_and_field() {
    let root = tempfile::tempdir().unwrap();
    let tables = write_scene(&street(4, 24.0), root.path());
    let unknown = "ffffffffffffffffffffffffffffffff".to_owned();
    let pose = token(6, 2);
    let cases: [(&str, &str, String, &str); 8] = [
        (
            "sample_data.json",
            &token(4, 0),
            unknown.clone(),
            "sample_token: sample.json has no row ffff",
        ),
        (
            "sample_data.json",
            &token(2, 0),
            unknown.clone(),
            "calibrated_sensor_token: calibrated_sensor.json has no row ffff",
        ),
        (
            "sample_data.json",
            &pose,
            unknown.clone(),
            "ego_pose_token: ego_pose.json has no row ffff",
        ),
        (
            "sample.json",
            &token(3, 0),
            unknown.clone(),
            "scene_token: scene.json has no row ffff",
        ),
        (
            "calibrated_sensor.json",
            &token(1, 1),
            unknown,
            "sensor_token: sensor.json has no row ffff",
        ),
        (
            "sample_data.json",
            &pose,
            "front".into(),
            "ego_pose_token: 'front' is not a token",
        ),
        (
            "ego_pose.json",
            "\"rotation\": [",
            "\"rotation\": [7.5,".into(),
            "rotation: ",
        ),
        (
            "sensor.json",
            "CAM_FRONT",
            "CAM_LEFT".into(),
            "channel: no sensor is called CAM_FRONT",
        ),
    ];
    for (name, from, to, expected) in cases {
        let path = tables.join(name);
        let good = fs::read_to_string(&path).unwrap();
        // Replace the last one: rows of another camera are ignored.
        let at = good.rfind(from).unwrap();
        let bad = good[..at].to_owned() + &to + &good[at + from.len()..];
        let line = good[..at].lines().count();
        fs::write(&path, &bad).unwrap();
        let error = open(root.path()).unwrap_err();
        let text = error.to_string();
        let field = expected.split(':').next().unwrap();
        if field == "channel" {
            assert!(text.contains(&format!("{name}:1: {expected}")), "{text}");
        } else if field == "rotation" {
            assert!(
                text.contains(&format!("{name}:")) && text.contains(expected),
                "{text}"
            );
        } else {
            assert!(
                text.contains(&format!("{name}:{line}: {expected}")),
                "{text}, not {line}"
            );
        }
        assert!(error.hint().is_some());
        fs::write(&path, good).unwrap();
    }
    let path = tables.join("ego_pose.json");
    let good = fs::read(&path).unwrap();
    fs::write(&path, &good[..good.len() / 2]).unwrap();
    let error = open(root.path()).unwrap_err().to_string();
    assert!(
        error.contains("ego_pose.json:") && error.contains("ends within the table"),
        "{error}"
    );
    fs::remove_file(&path).unwrap();
    let error = open(root.path()).unwrap_err();
    assert!(
        matches!(&error, Error::Missing { path, .. } if path.ends_with("ego_pose.json")),
        "{error}"
    );
    fs::write(&path, good).unwrap();
    // A truncated scan.
    let sweeps = root.path().join("samples/LIDAR_TOP");
    let scan = fs::read_dir(&sweeps)
        .unwrap()
        .next()
        .unwrap()
        .unwrap()
        .path();
    fs::write(&scan, [0_u8; 50]).unwrap();
    let error = open(root.path()).unwrap()[0]
        .ground_truth(0, GtKind::Z)
        .unwrap_err()
        .to_string();
    assert!(
        error.contains("50 bytes") && error.contains("20 bytes each"),
        "{error}"
    );
    // Two sets of tables describe the same drives.
    write(&root.path().join("v1.0-trainval/sample_data.json"), "[]");
    let error = open(root.path()).unwrap_err();
    assert!(
        error.to_string().contains("v1.0-mini, v1.0-trainval"),
        "{error}"
    );
    assert_eq!(open(&tables).unwrap().len(), 1);
}
