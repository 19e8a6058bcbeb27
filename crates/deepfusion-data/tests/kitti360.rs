//! KITTI-360 drives, written from a simulated street.

use crate::common::street::{
    check_intrinsics, check_motion, check_mount, check_path, check_truth, numbers, open, rows,
    street, write, write_picture, write_scan,
};
use deepfusion_data::{Camera, Cameras, Dataset, DatasetKind, Error, OpenOptions, inspect};
use deepfusion_geometry::Se3;
use deepfusion_hint::Hint;
use deepfusion_sim::Simulation;
use nalgebra::Vector3;
use std::f64::consts::PI;
use std::fs;
use std::path::{Path, PathBuf};

const DRIVE: &str = "2013_05_28_drive_0003_sync";
const BASELINE_M: f64 = 0.6;

fn shift(x: f64, y: f64, z: f64) -> Se3 {
    Se3::from_axis_angle(Vector3::zeros(), Vector3::new(x, y, z))
}

/// The transform from the vehicle's axes to the unit's (x forward, y right, z down).
fn pose_from_vehicle() -> Se3 {
    Se3::from_axis_angle(Vector3::x() * PI, Vector3::zeros())
}

/// The unit's pose, in a world whose origin is far away, like UTM's.
fn world_from_pose(street: &Simulation, frame: usize) -> Se3 {
    shift(1355.0, 3847.0, 115.0) * street.world_from_imu(frame) * pose_from_vehicle().inverse()
}

/// Writes the street as a drive. The simulator's camera is rectified camera 0; camera 1 is 60 cm to its right, rotated by its
/// rectification.
fn write_drive(street: &Simulation, root: &Path, cameras: &[u8]) -> PathBuf {
    let calibration = root.join("calibration");
    let k = street.intrinsics();
    let rect_from_raw = [
        Se3::from_axis_angle(Vector3::new(0.006, -0.011, 0.004), Vector3::zeros()),
        Se3::from_axis_angle(Vector3::new(-0.003, 0.008, -0.005), Vector3::zeros()),
    ];
    let rect_from_rect0 = [shift(0.0, 0.0, 0.0), shift(-BASELINE_M, 0.0, 0.0)];
    let cam_from_pose = street.rig().cam_from_imu() * pose_from_vehicle().inverse();
    let (mut perspective, mut to_pose) = (String::from("calib_time: 1-Jan-2013\n"), String::new());
    for n in 0..2 {
        let rotation = rect_from_raw[n].rotation();
        let p4 = k.fx * rect_from_rect0[n].translation().x;
        let p = [
            k.fx, 0.0, k.cx, p4, 0.0, k.fy, k.cy, 0.0, 0.0, 0.0, 1.0, 0.0,
        ];
        perspective += &format!(
            "S_rect_0{n}: {}.0 {}.0\nR_rect_0{n}: {}\nP_rect_0{n}: {}\n",
            k.width,
            k.height,
            numbers((0..9).map(|i| rotation[(i / 3, i % 3)])),
            numbers(p)
        );
        let pose_from_raw = (rect_from_rect0[n] * cam_from_pose).inverse() * rect_from_raw[n];
        to_pose += &format!("image_0{n}: {}\n", numbers(rows(&pose_from_raw)));
    }
    write(&calibration.join("perspective.txt"), perspective);
    write(&calibration.join("calib_cam_to_pose.txt"), to_pose);
    let velo_from_raw0 = street.rig().cam_from_velo().inverse() * rect_from_raw[0];
    let to_velo = numbers(rows(&velo_from_raw0));
    write(&calibration.join("calib_cam_to_velo.txt"), to_velo);
    let folder = root.join("data_2d_raw").join(DRIVE);
    for camera in cameras {
        let place = folder.join(format!("image_0{camera}"));
        for i in 0..street.frames() {
            write_picture(street, i, &place.join(format!("data_rect/{i:010}.png")));
        }
        let stamps: String = (0..street.frames())
            .map(|i| {
                format!(
                    "2013-05-28 08:46:{:012.9}\n",
                    2.904_112_64 + street.time_s(i)
                )
            })
            .collect();
        write(&place.join("timestamps.txt"), stamps);
    }
    // The fisheye cameras, whose folders have the names of KITTI raw's colour cameras.
    fs::create_dir_all(folder.join("image_02/data_rgb")).unwrap();
    let lines = (0..street.frames())
        .map(|i| format!("{i} {}\n", numbers(rows(&world_from_pose(street, i)))));
    write(&poses_file(root), lines.collect::<String>());
    folder
}

fn poses_file(root: &Path) -> PathBuf {
    root.join("data_poses").join(DRIVE).join("poses.txt")
}

fn scan_file(root: &Path, frame: usize) -> PathBuf {
    let place = root.join("data_3d_raw").join(DRIVE);
    place.join(format!("velodyne_points/data/{frame:010}.bin"))
}

#[test]
fn a_drive_has_the_simulators_camera_motion_path_and_depth() {
    let root = tempfile::tempdir().unwrap();
    let street = street(20, 10.0);
    let folder = write_drive(&street, root.path(), &[0]);
    write_scan(&street, 10, &scan_file(root.path(), 10));
    let places = [
        root.path().to_owned(),
        root.path().join("data_2d_raw"),
        folder,
    ];
    for place in &places {
        let all = open(place).unwrap();
        assert_eq!(
            (all.len(), all[0].kind(), all[0].name()),
            (1, DatasetKind::Kitti360, DRIVE)
        );
    }
    let dataset = open(root.path()).unwrap().remove(0);
    check_intrinsics(&dataset, &street);
    check_mount(&dataset, &street);
    check_motion(&dataset, &street, |i| i);
    check_path(&dataset, &street, |i| i);
    check_truth(&dataset, 10, &street.frame(10).depth);
    let seen = inspect(root.path()).unwrap();
    let json = serde_json::to_value(&seen).unwrap();
    assert_eq!(
        (json["kind"].as_str(), seen.drives[0].scans),
        (Some("kitti_360"), 1)
    );
}

/// Camera 1 moves with the same vehicle, 60 cm to the right; its ground truth uses its own rectification.
#[test]
fn the_right_camera_has_the_mount_in_the_files() {
    let root = tempfile::tempdir().unwrap();
    let street = street(6, 10.0);
    write_drive(&street, root.path(), &[0, 1]);
    write_scan(&street, 2, &scan_file(root.path(), 2));
    let options = OpenOptions {
        camera: Cameras::Both,
        ..OpenOptions::default()
    };
    let both = Dataset::open(root.path(), &options).unwrap();
    assert_eq!(
        (both[0].camera(), both[1].camera()),
        (Camera::Left, Camera::Right)
    );
    let pose = |d: &Dataset| d.camera_paths().unwrap()[0].world_from_cam[3];
    let left_from_right = pose(&both[0]).inverse() * pose(&both[1]);
    let off = left_from_right.translation() - Vector3::new(BASELINE_M, 0.0, 0.0);
    assert!(
        off.norm() < 1e-6 && left_from_right.angle() < 1e-8,
        "{left_from_right:?}"
    );
    // The same points from another viewpoint: a scan's pixels move to the left by f · baseline / depth.
    let kind = deepfusion_data::GtKind::Z;
    let [left, right] = [0, 1].map(|i: usize| both[i].ground_truth(2, kind).unwrap().unwrap());
    let fx = both[0].intrinsics(0).fx;
    let (mut found, mut all) = (0, 0);
    for (i, depth) in left.data.iter().enumerate().filter(|(_, d)| **d > 0.0) {
        let (u, v) = (i % left.width, i / left.width);
        let moved = u as f64 - fx * BASELINE_M / f64::from(*depth);
        if moved < 1.0 {
            continue;
        }
        // Rounding moves a pixel by at most one, unless a nearer point covers it.
        let near = (-1..=1).filter_map(|d| {
            right
                .data
                .get((v * left.width).checked_add_signed(moved.round() as isize + d)?)
        });
        all += 1;
        found += usize::from(near.into_iter().any(|d| (d - depth).abs() < 1e-3));
    }
    assert!(all > 1000 && found * 20 > all * 19, "{found} of {all}");
}

/// Frames at standstill have no pose, and the left camera's poses are used if the unit's are missing.
#[test]
fn poses_may_be_missing() {
    let root = tempfile::tempdir().unwrap();
    let street = street(30, 10.0);
    write_drive(&street, root.path(), &[0]);
    let poses = poses_file(root.path());
    let text = fs::read_to_string(&poses).unwrap();
    let kept = |i: usize| i >= 2 && !(10..20).contains(&i);
    let some: Vec<&str> = text
        .lines()
        .enumerate()
        .filter(|(i, _)| kept(*i))
        .map(|l| l.1)
        .collect();
    fs::write(&poses, some.join("\n")).unwrap();
    let by_unit = open(root.path()).unwrap().remove(0);
    let known = |d: &Dataset| {
        d.frames()
            .iter()
            .map(|f| f.speed_mps.is_some())
            .collect::<Vec<_>>()
    };
    // A frame just after the last pose still has a speed; one in the middle of a gap of a second does not.
    assert!(
        known(&by_unit)[5] && known(&by_unit)[25] && !known(&by_unit)[15] && !known(&by_unit)[0]
    );
    let paths = by_unit.camera_paths().unwrap();
    let ends: Vec<_> = paths
        .iter()
        .map(|p| (p.frames[0], p.frames.len()))
        .collect();
    assert_eq!(ends, [(2, 8), (20, 10)]);
    // The left camera's poses: 16 numbers, of a rectified camera.
    let lines = (0..30).map(|i| {
        let pose = shift(1355.0, 3847.0, 115.0) * street.world_from_cam(i);
        format!("{i} {} 0 0 0 1\n", numbers(rows(&pose)))
    });
    write(
        &poses.with_file_name("cam0_to_world.txt"),
        lines.collect::<String>(),
    );
    fs::remove_file(&poses).unwrap();
    let by_camera = open(root.path()).unwrap().remove(0);
    check_motion(&by_camera, &street, |i| i);
    check_path(&by_camera, &street, |i| i);
    fs::remove_file(poses.with_file_name("cam0_to_world.txt")).unwrap();
    let error = open(root.path()).unwrap()[0]
        .snippets(&[1], 0.5)
        .unwrap_err();
    assert!(error.hint().unwrap().contains("data_poses"), "{error}");
}

#[test]
fn errors_name_file_line_and_field() {
    let root = tempfile::tempdir().unwrap();
    let folder = write_drive(&street(4, 10.0), root.path(), &[0]);
    write(&scan_file(root.path(), 1), [0_u8; 32]);
    let poses = poses_file(root.path());
    let at = |name: &str| root.path().join("calibration").join(name);
    let (perspective, to_pose, to_velo) = (
        at("perspective.txt"),
        at("calib_cam_to_pose.txt"),
        at("calib_cam_to_velo.txt"),
    );
    let stamps = folder.join("image_00/timestamps.txt");
    let without = |path: &Path, from: &str, to: &str| {
        let text = fs::read_to_string(path).unwrap();
        assert!(text.contains(from));
        text.replacen(from, to, 1)
    };
    let cut = |path: &Path| {
        let text = fs::read_to_string(path).unwrap();
        text.trim_end().rsplit_once(' ').unwrap().0.to_owned()
    };
    let cases: [(&Path, String, &str); 8] = [
        (
            &poses,
            cut(&poses),
            "poses.txt:4: pose: 12 numbers, expected 13",
        ),
        (
            &poses,
            without(&poses, "\n1 ", "\n1.5 "),
            "poses.txt:2: value 1: 1.5 is not a frame number",
        ),
        (
            &poses,
            without(&poses, "\n3 ", "\n7 "),
            "timestamps.txt: 4 time stamps",
        ),
        (
            &perspective,
            without(&perspective, "P_rect_00", "P_rect_09"),
            "perspective.txt: P_rect_00: the file has no such line",
        ),
        (
            &perspective,
            without(&perspective, "S_rect_00: 320", "S_rect_00: wide"),
            "perspective.txt: S_rect_00: 'wide.0' is not a number",
        ),
        (
            &to_pose,
            without(&to_pose, "image_00: ", "image_00: 1 "),
            "calib_cam_to_pose.txt: image_00: 13 numbers, expected 12",
        ),
        (
            &to_velo,
            cut(&to_velo),
            "calib_cam_to_velo.txt:1: pose: 11 numbers, expected 12",
        ),
        (
            &stamps,
            without(&stamps, "2013-05-28", "yesterday"),
            "timestamps.txt:1:",
        ),
    ];
    for (path, text, expected) in cases {
        let good = fs::read_to_string(path).unwrap();
        fs::write(path, text).unwrap();
        let error = open(root.path()).unwrap_err();
        assert!(error.to_string().contains(expected), "{error}");
        assert!(error.hint().is_some(), "{error}");
        fs::write(path, good).unwrap();
    }
    fs::write(
        &perspective,
        without(&perspective, "S_rect_00: 320", "S_rect_00: 321"),
    )
    .unwrap();
    let error = open(root.path()).unwrap_err();
    assert!(matches!(error, Error::FrameSize { .. }), "{error}");
    fs::remove_file(&perspective).unwrap();
    let error = open(root.path()).unwrap_err();
    assert!(
        matches!(&error, Error::Missing { path, .. } if path.ends_with("calibration/perspective.txt")),
        "{error}"
    );
    fs::remove_dir_all(folder.join("image_00/data_rect")).unwrap();
    let error = open(root.path()).unwrap_err();
    assert!(
        matches!(&error, Error::NoImages { path, .. } if path.ends_with("image_00/data_rect")),
        "{error}"
    );
}
