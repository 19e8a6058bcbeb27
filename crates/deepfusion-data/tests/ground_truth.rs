//! Velodyne ground truth, compared with NumPy (`tests/reference/velodyne_numpy.py`), and its array file.

use crate::common::{self, TinyDrive};
use deepfusion_data::kitti::{Calibration, depth_map};
use deepfusion_data::{
    Camera, Cameras, Dataset, Error, GtKind, OpenOptions, Split, export_gt, ground_truth_names,
    load_rgb, overlay, read_depth_png, write_overlays,
};
use deepfusion_geometry::DepthMap;
use deepfusion_geometry::cloud::PointCloud;
use deepfusion_hint::Hint;
use ndarray::Array2;
use ndarray_npy::NpzReader;
use std::fs::{self, File};
use std::path::Path;

fn case(name: &str) -> (PointCloud, Calibration) {
    let from = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/reference");
    let folder = tempfile::tempdir().unwrap();
    for (reference, real) in [
        ("cam", Calibration::CAM_TO_CAM),
        ("velo", Calibration::VELO_TO_CAM),
    ] {
        let source = from.join(format!("velodyne_{name}_{reference}.txt"));
        fs::copy(source, folder.path().join(real)).unwrap();
    }
    let scan = PointCloud::read_kitti_bin(&from.join(format!("velodyne_{name}.bin"))).unwrap();
    (
        scan,
        Calibration::read(folder.path(), Camera::Left).unwrap(),
    )
}

fn expected(name: &str, kind: GtKind) -> Array2<f32> {
    let path =
        Path::new(env!("CARGO_MANIFEST_DIR")).join(format!("tests/reference/velodyne_{name}.npz"));
    let mut file = NpzReader::new(File::open(path).unwrap()).unwrap();
    file.by_name(&format!("{}.npy", kind.name()))
        .or_else(|_| file.by_name(kind.name()))
        .unwrap()
}

/// Forward distances are copied, so they must be equal; camera z is a sum of four products, whose order
/// may differ in the last bit of an f64, and so in an f32's last (6e-8).
fn assert_same(map: &DepthMap, expected: &Array2<f32>, tolerance: f32) {
    assert_eq!((map.height, map.width), expected.dim());
    for (i, (ours, numpys)) in map.data.iter().zip(expected).enumerate() {
        let (x, y) = (i % map.width, i / map.width);
        assert_eq!(
            *ours > 0.0,
            *numpys > 0.0,
            "at {x}, {y}: {ours} and {numpys}"
        );
        assert!(
            (ours - numpys).abs() <= tolerance * numpys,
            "at {x}, {y}: {ours} and {numpys}"
        );
    }
}

#[test]
fn both_conventions_equal_numpys_pixel_for_pixel() {
    for name in ["exact", "real"] {
        let (scan, calibration) = case(name);
        let k = calibration.intrinsics;
        let projection = calibration.require_pixels_from_velo().unwrap();
        for (kind, tolerance) in [(GtKind::Z, 1e-7), (GtKind::Velodyne, 0.0)] {
            let size = (k.width as usize, k.height as usize);
            let map = depth_map(&scan, &projection, size, kind);
            assert!(map.count() > 500);
            assert_same(&map, &expected(name, kind), tolerance);
        }
    }
}

#[test]
fn the_two_conventions_differ_by_a_pixel_and_the_sensors_offset() {
    let (_, calibration) = case("real");
    let point = PointCloud {
        xyz: vec![[12.0, 0.5, -0.5]],
        ..PointCloud::default()
    };
    let projection = calibration.require_pixels_from_velo().unwrap();
    let only = |kind| {
        let map = depth_map(&point, &projection, (124, 38), kind);
        let i = map.data.iter().position(|d| *d > 0.0).unwrap();
        (i % 124, i / 124, map.data[i])
    };
    let ((x, y, z), (xv, yv, forward)) = (only(GtKind::Z), only(GtKind::Velodyne));
    assert_eq!((x, y), (xv + 1, yv + 1));
    assert!(forward == 12.0 && (z - 11.7).abs() < 0.05, "{z} {forward}");
}

fn open(path: &Path, camera: Cameras) -> Vec<Dataset> {
    Dataset::open(
        path,
        &OpenOptions {
            camera,
            split: None,
            ..OpenOptions::default()
        },
    )
    .unwrap()
}

#[test]
fn a_drives_scans_are_exported_by_frame() {
    let root = tempfile::tempdir().unwrap();
    let drive = TinyDrive {
        scans: vec![2, 5],
        ..TinyDrive::default()
    }
    .write(root.path());
    let out = root.path().join("gt.npz");
    let datasets = open(&drive, Cameras::Left);
    let mut steps = Vec::new();
    let mut progress = |done, all| steps.push((done, all));
    let written = export_gt(&datasets, GtKind::Z, &out, &mut progress).unwrap();
    assert_eq!((written, steps.last()), (2, Some(&(8, 8))));

    let mut npz = NpzReader::new(File::open(&out).unwrap()).unwrap();
    assert_eq!(names(&mut npz), ["0000000002", "0000000005"]);
    let array: Array2<f32> = npz
        .by_name("0000000005.npy")
        .or_else(|_| npz.by_name("0000000005"))
        .unwrap();
    let map = datasets[0].ground_truth(5, GtKind::Z).unwrap().unwrap();
    assert_same(&map, &array, 0.0);
    // The wall is 12 m ahead of the velodyne, 0.27 m behind the camera.
    let wall = map.data.iter().copied().fold(0.0, f32::max);
    assert!(
        (11.5..12.0).contains(&wall) && map.count() > 50,
        "{wall} {}",
        map.count()
    );
    assert!(datasets[0].ground_truth(4, GtKind::Z).unwrap().is_none());
}

fn names(npz: &mut NpzReader<File>) -> Vec<String> {
    let mut names = npz.names().unwrap();
    names
        .iter_mut()
        .for_each(|n| *n = n.trim_end_matches(".npy").to_owned());
    names.sort();
    names
}

#[test]
fn names_include_drive_and_camera_if_there_are_several() {
    let root = tempfile::tempdir().unwrap();
    let tiny = TinyDrive {
        frames: vec![0, 1],
        scans: vec![1],
        cameras: vec![2, 3],
        ..TinyDrive::default()
    };
    tiny.write_as(root.path(), "2030_01_02/a_sync");
    tiny.write_as(root.path(), "2030_01_02/b_sync");
    let out = root.path().join("gt.npz");
    let export = |datasets: &[Dataset]| {
        export_gt(datasets, GtKind::Velodyne, &out, &mut |_, _| {}).unwrap();
        names(&mut NpzReader::new(File::open(&out).unwrap()).unwrap())
    };
    let date = root.path().join("2030_01_02");
    let left = open(&date, Cameras::Left);
    assert_eq!(export(&left), ["a_sync/0000000001", "b_sync/0000000001"]);
    let both = open(&date.join("a_sync"), Cameras::Both);
    assert_eq!(
        export(&both),
        ["image_02/0000000001", "image_03/0000000001"]
    );
}

/// Published lists are shuffled within drives, and a stack of predictions is in the list's order.
#[test]
fn scans_are_exported_in_the_order_of_the_split() {
    let root = tempfile::tempdir().unwrap();
    let tiny = TinyDrive {
        frames: (0..4).collect(),
        scans: (0..4).collect(),
        ..TinyDrive::default()
    };
    for drive in ["a_sync", "b_sync"] {
        tiny.write_as(root.path(), &format!("2030_01_02/{drive}"));
    }
    let list = root.path().join("test_files.txt");
    let lines = [("b_sync", 3), ("a_sync", 2), ("b_sync", 0), ("a_sync", 1)];
    let written = lines.map(|(drive, frame)| format!("2030_01_02/{drive} {frame} l\n"));
    fs::write(&list, written.concat()).unwrap();
    let options = OpenOptions {
        split: Some(Split::read(&list).unwrap()),
        ..OpenOptions::default()
    };
    let datasets = Dataset::open(&root.path().join("2030_01_02"), &options).unwrap();
    let out = root.path().join("gt.npz");
    let export = |datasets: &[Dataset]| {
        export_gt(datasets, GtKind::Z, &out, &mut |_, _| {}).unwrap();
        let mut npz = NpzReader::new(File::open(&out).unwrap()).unwrap();
        npz.names().unwrap()
    };
    let expected = lines.map(|(drive, frame)| format!("{drive}/{frame:010}"));
    assert_eq!(export(&datasets), expected);
    // Frames outside the split come after it.
    let outside = open(&root.path().join("2030_01_02/a_sync"), Cameras::Left);
    let mixed: Vec<Dataset> = outside.into_iter().chain(datasets).collect();
    let names = export(&mixed);
    assert_eq!(names[..4], expected);
    assert_eq!(names[4..], ["a_sync/0000000000", "a_sync/0000000003"]);
}

#[test]
fn drives_with_the_same_name_get_different_array_names() {
    let root = tempfile::tempdir().unwrap();
    let tiny = TinyDrive {
        frames: vec![0],
        scans: vec![0],
        ..TinyDrive::default()
    };
    let [first, second] = ["2030_01_02", "2030_01_03"].map(|date| {
        open(
            &tiny.write_as(root.path(), &format!("{date}/a_sync")),
            Cameras::Left,
        )
    });
    let out = root.path().join("gt.npz");
    let export = |datasets: &[Dataset]| {
        export_gt(datasets, GtKind::Z, &out, &mut |_, _| {}).unwrap();
        names(&mut NpzReader::new(File::open(&out).unwrap()).unwrap())
    };
    let both = [first.clone(), second].concat();
    assert_eq!(export(&both), ["a_sync-2/0000000000", "a_sync/0000000000"]);
    let backwards: Vec<Dataset> = both.iter().rev().cloned().collect();
    let by_order = ground_truth_names(&backwards).concat();
    assert_eq!(by_order, ["a_sync-2/0000000000", "a_sync/0000000000"]);
    // A drive given twice is written once.
    assert_eq!(export(&[first.clone(), first].concat()), ["0000000000"]);
}

#[test]
fn every_scan_is_drawn_on_its_image() {
    let root = tempfile::tempdir().unwrap();
    let tiny = |scans| TinyDrive {
        frames: vec![0, 1],
        scans,
        ..TinyDrive::default()
    };
    let drive = tiny(vec![1]).write_as(root.path(), "2030_01_02/a_sync");
    let without = tiny(vec![]).write_as(root.path(), "2030_01_02/b_sync");
    let out = root.path().join("overlays");
    let draw = |path: &Path| {
        let mut steps = Vec::new();
        let mut progress = |done, all| steps.push((done, all));
        let written = write_overlays(path, &OpenOptions::default(), &out, &mut progress);
        (written, steps)
    };
    let (written, steps) = draw(&root.path().join("2030_01_02"));
    assert_eq!((written.unwrap(), steps.last()), (1, Some(&(4, 4))));
    let picture = load_rgb(&out.join("a_sync/0000000001.png")).unwrap();
    let plain = open(&drive, Cameras::Left)[0].load_image(1).unwrap();
    assert_eq!(picture.dimensions(), plain.dimensions());
    assert_ne!(picture, plain);
    let (none, _) = draw(&without);
    assert!(matches!(none, Err(Error::NoScans { frames: 2, .. })));
}

#[test]
fn bad_scans_are_errors_and_leave_no_file() {
    let root = tempfile::tempdir().unwrap();
    let drive = TinyDrive {
        scans: vec![3],
        ..TinyDrive::default()
    }
    .write(root.path());
    let scan = drive.join("velodyne_points/data/0000000003.bin");
    let bytes = fs::read(&scan).unwrap();
    fs::write(&scan, &bytes[..bytes.len() - 5]).unwrap();
    let out = root.path().join("gt.npz");
    let export = || {
        export_gt(
            &open(&drive, Cameras::Left),
            GtKind::Z,
            &out,
            &mut |_, _| {},
        )
    };
    let error = export().unwrap_err();
    assert!(error.to_string().contains("0000000003.bin"), "{error}");
    assert!(error.hint().is_some());
    fs::remove_file(&scan).unwrap();
    assert!(matches!(
        export().unwrap_err(),
        Error::NoScans { frames: 8, .. }
    ));
    fs::write(&scan, &bytes).unwrap();
    fs::remove_file(drive.join("../calib_velo_to_cam.txt")).unwrap();
    let error = export().unwrap_err();
    assert!(
        error.to_string().contains("calib_velo_to_cam.txt"),
        "{error}"
    );
    assert!(!out.exists());
    let leftovers = fs::read_dir(root.path()).unwrap().count();
    assert_eq!(leftovers, 1, "only the date folder");
}

/// KITTI's own projection of the scan of drive 0001, frame 5 (which merges eleven scans after
/// correcting for motion) agrees with ours: at common pixels, the median difference is small.
#[test]
fn real_ground_truth_agrees_with_kittis_annotation() {
    let inner = "kitti_raw/2011_09_26/2011_09_26_drive_0001_sync";
    let annotated = "kitti_depth/val_like/2011_09_26_drive_0001_sync/proj_depth/groundtruth/image_02/0000000005.png";
    let (Some(drive), Some(png)) = (common::real_data(inner), common::real_data(annotated)) else {
        return;
    };
    let dataset = &open(&drive, Cameras::Left)[0];
    let ours = dataset.ground_truth(0, GtKind::Z).unwrap().unwrap();
    let theirs = read_depth_png(&png).unwrap();
    assert_eq!((ours.width, ours.height), (theirs.width, theirs.height));
    let both = ours
        .data
        .iter()
        .zip(&theirs.data)
        .filter(|(a, b)| **a > 0.0 && **b > 0.0);
    let mut errors: Vec<f32> = both.map(|(a, b)| (a - b).abs() / b).collect();
    errors.sort_by(f32::total_cmp);
    assert!(errors.len() > 5000, "{}", errors.len());
    let median = errors[errors.len() / 2];
    assert!(median < 0.005, "{median}");
    let picture = overlay(&dataset.load_image(0).unwrap(), &ours).unwrap();
    assert_eq!(picture.dimensions(), (1242, 375));
}
