//! Sequences of KITTI's odometry benchmark, written from a simulated street.

use crate::common;
use crate::common::street::{
    check_intrinsics, check_motion, check_path, check_truth, numbers, open, rows, street, write,
    write_picture, write_scan,
};
use deepfusion_data::{
    Camera, Cameras, Dataset, DatasetKind, Error, GtKind, OpenOptions, Split, inspect,
};
use deepfusion_geometry::Se3;
use deepfusion_hint::Hint;
use deepfusion_sim::Simulation;
use nalgebra::Vector3;
use std::fs;
use std::path::{Path, PathBuf};

/// Camera 2 and 3 are this far left of camera 0: t = P₄ / f.
const SHIFTS: [f64; 4] = [0.0, -0.54, 0.06, -0.47];

/// Writes the street as a sequence; `cameras` are the image folders, `poses` is whether poses are published.
fn write_sequence(
    street: &Simulation,
    root: &Path,
    name: &str,
    cameras: &[u8],
    poses: bool,
) -> PathBuf {
    let folder = root.join("sequences").join(name);
    let k = street.intrinsics();
    let mut calib = String::new();
    for (n, shift) in SHIFTS.iter().enumerate() {
        let p = [
            k.fx,
            0.0,
            k.cx,
            k.fx * shift,
            0.0,
            k.fy,
            k.cy,
            0.0,
            0.0,
            0.0,
            1.0,
            0.0,
        ];
        calib += &format!("P{n}: {}\n", numbers(p));
    }
    calib += &format!("Tr: {}\n", numbers(rows(&street.rig().cam0_from_velo)));
    write(&folder.join("calib.txt"), calib);
    let times: String = (0..street.frames())
        .map(|i| format!("{:.12e}\n", street.time_s(i)))
        .collect();
    write(&folder.join("times.txt"), times);
    for camera in cameras {
        for i in 0..street.frames() {
            write_picture(
                street,
                i,
                &folder.join(format!("image_{camera}/{i:06}.png")),
            );
        }
    }
    if poses {
        let cam2_from_cam0 =
            Se3::from_axis_angle(Vector3::zeros(), Vector3::new(SHIFTS[2], 0.0, 0.0));
        let world_from_cam0 = |i| street.world_from_cam(i) * cam2_from_cam0;
        let first = world_from_cam0(0).inverse();
        let lines =
            (0..street.frames()).map(|i| numbers(rows(&(first * world_from_cam0(i)))) + "\n");
        write(
            &root.join(format!("poses/{name}.txt")),
            lines.collect::<String>(),
        );
    }
    folder
}

#[test]
fn a_sequence_has_the_simulators_camera_motion_path_and_depth() {
    let root = tempfile::tempdir().unwrap();
    let street = street(40, 10.0);
    let folder = write_sequence(&street, root.path(), "04", &[2], true);
    for i in [0, 20] {
        write_scan(&street, i, &folder.join(format!("velodyne/{i:06}.bin")));
    }
    let by_root = open(root.path()).unwrap();
    let by_sequence = open(&folder).unwrap();
    let [dataset] = &by_root[..] else {
        panic!("{} data sets", by_root.len());
    };
    assert_eq!(by_sequence[0].frames(), dataset.frames());
    assert_eq!(
        (dataset.kind(), dataset.name()),
        (DatasetKind::KittiOdometry, "04")
    );
    assert_eq!(
        (dataset.camera(), dataset.frames().len()),
        (Camera::Left, 40)
    );
    check_intrinsics(dataset, &street);
    assert!((dataset.frames()[7].time_s.unwrap() - street.time_s(7)).abs() < 1e-9);
    check_motion(dataset, &street, |i| i);
    check_path(dataset, &street, |i| i);
    // The simulator's rig differs from that of KITTI's car by a centimetre, and the drive is too short for the pitch to average out.
    let mount = dataset.cam_from_vehicle().unwrap().inverse() * street.rig().cam_from_imu();
    assert!(
        mount.angle() < 0.01 && mount.translation().norm() < 0.05,
        "{mount:?}"
    );
    check_truth(dataset, 20, &street.frame(20).depth);
    assert!(
        !dataset.has_ground_truth(1, GtKind::Z)
            && dataset.ground_truth(1, GtKind::Z).unwrap().is_none()
    );
    let seen = inspect(root.path()).unwrap();
    assert_eq!(
        (seen.kind, seen.drives[0].scans),
        (DatasetKind::KittiOdometry, 2)
    );
    let json = serde_json::to_value(&seen).unwrap();
    assert_eq!(json["kind"], "kitti_odometry");
    let warnings = common::text_of(&seen.drives[0].warnings);
    assert!(warnings.contains("KITTI raw's calibration"), "{warnings}");
}

#[test]
fn grey_cameras_are_used_without_colour_and_all_sequences_are_opened() {
    let root = tempfile::tempdir().unwrap();
    let street = street(3, 10.0);
    write_sequence(&street, root.path(), "04", &[0, 1], true);
    write_sequence(&street, root.path(), "11", &[2, 0], false);
    let options = OpenOptions {
        camera: Cameras::Both,
        ..OpenOptions::default()
    };
    let all = Dataset::open(root.path(), &options).unwrap();
    let found: Vec<_> = all
        .iter()
        .map(|d| (d.name(), d.camera(), d.frames()[0].image.to_string()))
        .collect();
    for ((name, camera, image), (expected, side, folder)) in found.iter().zip([
        ("04", Camera::Left, "image_0"),
        ("04", Camera::Right, "image_1"),
        ("11", Camera::Left, "image_2"),
    ]) {
        assert_eq!((*name, *camera), (expected, side));
        assert!(image.contains(folder), "{image}");
    }
    assert_eq!(all.len(), 3, "sequence 11 has no right camera");
    // Grey cameras 0 and 1 are 0.54 m apart.
    let x = |d: &Dataset| {
        d.camera_paths().unwrap()[0].world_from_cam[0]
            .translation()
            .x
    };
    assert!((x(&all[0]) - x(&all[1]) + 0.54).abs() < 1e-9);
    // Without poses there is no motion, with an error; everything else works.
    let hidden = &all[2];
    assert!(hidden.track().is_none() && hidden.load_image(1).is_ok());
    let error = hidden.snippets(&[1], 0.5).unwrap_err();
    assert!(error.to_string().contains("no speeds"), "{error}");
    assert!(error.hint().unwrap().contains("00 to 10"), "{error}");
    assert!(matches!(hidden.camera_paths(), Err(Error::NoPath { .. })));
}

#[test]
fn monodepth2s_splits_select_frames() {
    let root = tempfile::tempdir().unwrap();
    write_sequence(&street(4, 10.0), root.path(), "09", &[2, 3], true);
    let split = root.path().join("test_files_09.txt");
    // As in Monodepth2's lists, and with the folder's own name.
    fs::write(&split, "9 0 l\n9 2 r\n09 3 l\n8 1 l\n").unwrap();
    let options = OpenOptions {
        camera: Cameras::Both,
        split: Some(Split::read(&split).unwrap()),
        ..OpenOptions::default()
    };
    let both = Dataset::open(root.path(), &options).unwrap();
    assert_eq!(
        (both[0].selected(), both[1].selected()),
        (&[0, 3][..], &[2][..])
    );
    let coverage = options.split.as_ref().unwrap().coverage(&both);
    assert_eq!((coverage.found, coverage.expected), (3, 4));
    assert_eq!(coverage.first_missing.as_deref(), Some("8 1 l"));
    // A frame that is in no sequence selects nothing.
    fs::write(&split, "3 1 l\n").unwrap();
    let options = OpenOptions {
        split: Some(Split::read(&split).unwrap()),
        ..OpenOptions::default()
    };
    let error = Dataset::open(root.path(), &options).unwrap_err();
    assert!(
        matches!(error, Error::SplitSelectsNothing { .. }),
        "{error}"
    );
}

/// The published lists, if available: `sequence frame side`, with the benchmark's numbers.
#[test]
fn published_splits_are_read() {
    let Some(folder) = common::real_data("splits/odom") else {
        return;
    };
    let read = |name: &str| Split::read(&folder.join(name)).unwrap();
    let test = read("test_files_09.txt");
    assert_eq!((test.len(), test.entries[0].folder.as_str()), (1590, "9"));
    let train = read("train_files.txt");
    assert!(train.entries.iter().any(|e| e.camera == Camera::Right));
}

#[test]
fn errors_name_file_line_and_field() {
    let root = tempfile::tempdir().unwrap();
    let folder = write_sequence(&street(4, 10.0), root.path(), "04", &[2], true);
    let poses = root.path().join("poses/04.txt");
    let (calib, times) = (folder.join("calib.txt"), folder.join("times.txt"));
    let lines = |path: &Path, line: usize, change: &dyn Fn(&str) -> String| {
        let text = fs::read_to_string(path).unwrap();
        let changed = text
            .lines()
            .enumerate()
            .map(|(i, l)| if i == line { change(l) } else { l.to_owned() });
        changed.collect::<Vec<_>>().join("\n")
    };
    let last = |l: &str| l.rsplit_once(' ').unwrap().0.to_owned();
    let cases: [(&Path, String, &[&str]); 9] = [
        (
            &poses,
            lines(&poses, 2, &last),
            &["04.txt:3: pose: 11 numbers, expected 12"],
        ),
        (
            &poses,
            lines(&poses, 1, &|l| format!("{l} 7")),
            &["04.txt:2: pose: 13 numbers"],
        ),
        (
            &poses,
            lines(&poses, 1, &|l| format!("x{l}")),
            &["04.txt:2: value 1 of 12: 'x"],
        ),
        (
            &poses,
            lines(&poses, 3, &|_| "0 ".repeat(12)),
            &["04.txt:4: pose: its matrix is not a rotation"],
        ),
        (
            &calib,
            lines(&calib, 2, &|_| String::new()),
            &["calib.txt: P2: the file has no such line"],
        ),
        (
            &calib,
            lines(&calib, 2, &last),
            &["calib.txt: P2: 11 numbers, expected 12"],
        ),
        (
            &times,
            lines(&times, 1, &|_| "soon".into()),
            &["times.txt:2: 'soon' is not a time"],
        ),
        (
            &times,
            lines(&times, 2, &|_| "0".into()),
            &["times.txt:3: '0' is not after"],
        ),
        (
            &times,
            "0.0\n0.1".into(),
            &["times.txt: 2 time stamps", "frame 2"],
        ),
    ];
    for (path, text, expected) in cases {
        let good = fs::read_to_string(path).unwrap();
        fs::write(path, text).unwrap();
        let error = open(root.path()).unwrap_err();
        for part in expected {
            assert!(error.to_string().contains(part), "{error}");
        }
        assert!(error.hint().is_some(), "{error}");
        fs::write(path, good).unwrap();
    }
    // Scans need the scanner's mount.
    write(&folder.join("velodyne/000001.bin"), [0_u8; 32]);
    let good = fs::read_to_string(&calib).unwrap();
    fs::write(&calib, lines(&calib, 4, &|_| String::new())).unwrap();
    let error = open(root.path()).unwrap_err().to_string();
    assert!(
        error.contains("calib.txt: Tr: the file has no such line"),
        "{error}"
    );
    fs::write(&calib, good).unwrap();
    // A missing image is a gap in the numbers, a truncated one an error.
    let image = folder.join("image_2/000002.png");
    let bytes = fs::read(&image).unwrap();
    fs::remove_file(&image).unwrap();
    let gap = inspect(root.path()).unwrap();
    assert_eq!(gap.drives[0].missing_frames, [[2, 2]]);
    fs::write(&image, &bytes[..20]).unwrap();
    let error = open(root.path()).unwrap_err().to_string();
    assert!(error.contains("image_2/000002.png"), "{error}");
    fs::remove_file(&calib).unwrap();
    let error = open(&folder).unwrap_err();
    assert!(
        matches!(&error, Error::Missing { path, .. } if path == &calib.canonicalize().unwrap_or(calib.clone())),
        "{error}"
    );
    let own = OpenOptions {
        intrinsics: Some([1.0; 4]),
        ..OpenOptions::default()
    };
    let error = Dataset::open(&folder, &own).unwrap_err().to_string();
    assert!(
        error.contains("KITTI odometry includes its own calibration"),
        "{error}"
    );
}

#[test]
fn without_times_there_are_frames_and_depth_but_no_motion() {
    let root = tempfile::tempdir().unwrap();
    let folder = write_sequence(&street(3, 10.0), root.path(), "04", &[2], true);
    fs::remove_file(folder.join("times.txt")).unwrap();
    let dataset = open(root.path()).unwrap().remove(0);
    assert!(
        dataset
            .frames()
            .iter()
            .all(|f| f.time_s.is_none() && f.speed_mps.is_none())
    );
    assert_eq!(dataset.camera_paths().unwrap()[0].world_from_cam.len(), 3);
    let error = dataset.snippets(&[1], 0.5).unwrap_err();
    let hint = error.hint().unwrap_or_default();
    assert!(hint.contains("times.txt"), "{error}: {hint}");
}

/// A folder with a `dataset.toml` is an image folder, whatever the names of its files.
#[test]
fn an_image_folder_with_a_sequences_names_is_not_a_sequence() {
    let root = tempfile::tempdir().unwrap();
    let folder = write_sequence(&street(3, 10.0), root.path(), "04", &[2], true);
    write(
        &folder.join("dataset.toml"),
        "images = \"image_2\"\nintrinsics = [230, 230, 160, 48]\n",
    );
    let dataset = open(&folder).unwrap().remove(0);
    assert_eq!(dataset.kind(), DatasetKind::Folder);
}

/// Sequences are often links to another disk, with their poses beside the link.
#[cfg(unix)]
#[test]
fn a_linked_sequence_has_its_poses() {
    let root = tempfile::tempdir().unwrap();
    let folder = write_sequence(&street(5, 10.0), root.path(), "04", &[2], true);
    let elsewhere = root.path().join("disk");
    fs::rename(&folder, &elsewhere).unwrap();
    std::os::unix::fs::symlink(&elsewhere, &folder).unwrap();
    let dataset = open(&folder).unwrap().remove(0);
    assert_eq!(
        (dataset.name(), dataset.snippets(&[1], 0.5).is_ok()),
        ("04", true)
    );
}
