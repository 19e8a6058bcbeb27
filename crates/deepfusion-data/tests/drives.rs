//! Opening recordings, and every error of opening.

use crate::common::{self, TinyDrive, text_of};
use deepfusion_data::kitti::{Calibration, find_drives};
use deepfusion_data::{Camera, Cameras, Dataset, Error, OpenOptions, inspect, inspect_with};
use deepfusion_hint::Hint;
use proptest::prelude::*;
use std::fs;
use std::path::Path;

fn open(path: &Path) -> Result<Vec<Dataset>, Error> {
    Dataset::open(path, &OpenOptions::default())
}

fn refusal(path: &Path) -> String {
    let error = open(path).unwrap_err();
    let hint = error.hint().expect("every refusal has a hint");
    format!("{error}\nhint: {hint}")
}

#[test]
fn a_drive_a_date_and_a_root_open_the_same() {
    let root = tempfile::tempdir().unwrap();
    let drive = TinyDrive::default().write(root.path());
    TinyDrive::default().write_as(root.path(), "2030_01_03/2030_01_03_drive_0001_sync");
    assert_eq!(open(&drive).unwrap().len(), 1);
    assert_eq!(open(drive.parent().unwrap()).unwrap().len(), 1);
    let all = open(root.path()).unwrap();
    let names: Vec<&str> = all.iter().map(Dataset::split_name).collect();
    assert_eq!(
        names,
        [common::DRIVE, "2030_01_03/2030_01_03_drive_0001_sync"]
    );
    let frame = &all[0].frames()[3];
    assert_eq!(
        (frame.number, frame.drive.as_str()),
        (3, "2030_01_02_drive_0007_sync")
    );
    assert!((frame.time_s.unwrap() - 0.309).abs() < 1e-9);
    assert_eq!(all[0].load_image(3).unwrap().get_pixel(1, 1).0, [4, 13, 90]);
}

/// The folders of a fleet may be roots of several drives, have the same names, and lack a camera.
#[test]
fn drives_without_images_of_the_camera_are_left_out() {
    let fleet = tempfile::tempdir().unwrap();
    for (place, cameras) in [("a", vec![2]), ("b", vec![2, 3])] {
        let drive = TinyDrive {
            cameras,
            ..TinyDrive::default()
        };
        drive.write(&fleet.path().join(place));
    }
    fs::write(fleet.path().join("dataset.toml"), "for_folders = true\n").unwrap();
    let both = open(fleet.path()).unwrap();
    assert_eq!(both.len(), 2);
    assert_eq!(both[0].name(), both[1].name());
    assert_ne!(both[0].place(), both[1].place());
    let right = || {
        let options = OpenOptions {
            camera: Cameras::Right,
            ..OpenOptions::default()
        };
        Dataset::open(fleet.path(), &options)
    };
    let found = right().unwrap();
    assert_eq!(found.len(), 1);
    let warnings = text_of(found[0].warnings());
    assert!(
        warnings.contains("left out for lack of images: a"),
        "{warnings}"
    );
    fs::remove_dir_all(fleet.path().join("b")).unwrap();
    let error = right().unwrap_err();
    assert!(matches!(error, Error::NoImages { .. }), "{error}");
}

#[test]
fn one_camera_or_both_are_opened() {
    let root = tempfile::tempdir().unwrap();
    let drive = TinyDrive {
        cameras: vec![2, 3],
        ..TinyDrive::default()
    }
    .write(root.path());
    let cameras = |camera| -> Vec<Camera> {
        let all = Dataset::open(
            &drive,
            &OpenOptions {
                camera,
                ..OpenOptions::default()
            },
        )
        .unwrap();
        all.iter().map(Dataset::camera).collect()
    };
    assert_eq!(cameras(Cameras::Right), [Camera::Right]);
    assert_eq!(cameras(Cameras::Both), [Camera::Left, Camera::Right]);
    assert_eq!("both".parse(), Ok(Cameras::Both));
    let refused = "4".parse::<Cameras>().unwrap_err().to_string();
    assert!(refused.contains("2, 3 or both"), "{refused}");
    fs::remove_dir_all(drive.join("image_02")).unwrap();
    let text = refusal(&drive);
    assert!(
        text.contains("image_02") && text.contains("other camera"),
        "{text}"
    );
}

#[test]
fn a_camera_given_for_kitti_is_refused() {
    let root = tempfile::tempdir().unwrap();
    let drive = TinyDrive::default().write(root.path());
    let options = OpenOptions {
        intrinsics: Some([36.0, 36.0, 30.5, 8.6]),
        ..OpenOptions::default()
    };
    let error = Dataset::open(&drive, &options).unwrap_err();
    assert!(error.to_string().contains("its own calibration"), "{error}");
}

#[test]
fn the_cameras_position_comes_from_p_rect() {
    let root = tempfile::tempdir().unwrap();
    let date = TinyDrive::default().write(root.path()).join("..");
    let read = |camera| Calibration::read(&date, camera).unwrap();
    let (left, right) = (read(Camera::Left), read(Camera::Right));
    let k = left.intrinsics;
    assert_eq!((k.fx, k.cy, k.width, k.height), (36.0, 8.6, 62, 19));
    // Camera 3 is 0.06 + 0.47 m to the right of camera 2, with the same orientation.
    let right_from_left = right.cam_from_velo.unwrap() * left.cam_from_velo.unwrap().inverse();
    let t = right_from_left.translation();
    assert!(
        (t.x + 0.53).abs() < 1e-9 && t.y.abs() < 1e-9 && t.z.abs() < 1e-9,
        "{t}"
    );
    assert!(right_from_left.angle() < 1e-9);
    // The projection by rigid transforms agrees with that by the printed matrices, up to their six decimals.
    let point = nalgebra::Vector3::new(15.0, 2.0, -1.0);
    let rigid = k
        .project(&left.cam_from_velo.unwrap().transform(&point))
        .unwrap();
    let q = left.require_pixels_from_velo().unwrap() * point.push(1.0);
    assert!((rigid.x - q.x / q.z).abs() < 1e-3 && (rigid.y - q.y / q.z).abs() < 1e-3);
    // The IMU's axes in the camera's: forward is +z, up is -y.
    let cam_from_imu = left.cam_from_imu.unwrap();
    assert!(cam_from_imu.rotate(&nalgebra::Vector3::x()).z > 0.99);
    assert!(cam_from_imu.rotate(&nalgebra::Vector3::z()).y < -0.99);
}

#[test]
fn missing_and_empty_paths_are_errors() {
    let text = refusal(Path::new("/no/such/drive"));
    assert!(
        text.contains("/no/such/drive: no such file or folder"),
        "{text}"
    );
    let empty = tempfile::tempdir().unwrap();
    for hidden in [".DS_Store", ".drive.17-2.partial.lock"] {
        fs::write(empty.path().join(hidden), "x").unwrap();
    }
    let text = refusal(empty.path());
    assert!(text.contains("it is empty"), "{text}");
    assert!(!text.contains("known layouts"), "{text}");
}

#[test]
fn errors_describe_what_was_found_instead() {
    let dir = tempfile::tempdir().unwrap();
    let at = |name: &str| dir.path().join(name);
    // With the reader, the error is more precise.
    let mcap = if cfg!(feature = "ros2") {
        "not an MCAP file"
    } else {
        "it is a ROS 2 bag"
    };
    for (file, found) in [
        ("x.mcap", mcap),
        ("x.PNG", "single image"),
        ("x.zip", "packed"),
    ] {
        fs::write(at(file), "x").unwrap();
        let text = refusal(&at(file));
        assert!(text.contains(found), "{text}");
        fs::remove_file(at(file)).unwrap();
    }
    for i in 0..3 {
        fs::write(at(&format!("{i}.jpg")), "x").unwrap();
    }
    // A folder of images that are invalid.
    let text = refusal(dir.path());
    assert!(text.contains("0.jpg: neither a PNG nor a JPEG"), "{text}");
    for i in 0..3 {
        fs::remove_file(at(&format!("{i}.jpg"))).unwrap();
    }
    fs::create_dir_all(at("logs/2020")).unwrap();
    fs::write(at("readme.md"), "x").unwrap();
    let text = refusal(dir.path());
    assert!(
        text.contains("1 file and 1 folder, such as readme.md"),
        "{text}"
    );
    // All known layouts are listed, on one line.
    let listed = text.lines().find(|line| line.starts_with("known layouts"));
    for layout in [
        "image_02/",
        "processed_log/",
        ".color.png",
        ".mp4",
        "images/",
    ] {
        assert!(listed.unwrap().contains(layout), "{layout}: {text}");
    }
    for name in ["monday", "tuesday"] {
        fs::create_dir(at(name)).unwrap();
        fs::write(at(name).join("1.jpg"), "x").unwrap();
    }
    let text = refusal(dir.path());
    assert!(
        text.contains("a folder with 2 recordings") && text.contains("monday)"),
        "{text}"
    );
    let first = at("monday");
    assert!(
        text.contains(&format!("one of them, such as {};", first.display())),
        "{text}"
    );
    assert!(text.contains("for_folders = true"), "{text}");
}

#[test]
fn a_folder_within_a_drive_is_recognised() {
    let root = tempfile::tempdir().unwrap();
    let drive = TinyDrive::default().write(root.path());
    for inner in ["image_02", "image_02/data", "oxts"] {
        let text = refusal(&drive.join(inner));
        assert!(
            text.contains("part of the drive") && text.contains("drive_0007_sync"),
            "{text}"
        );
        let drive = drive.canonicalize().unwrap();
        let hint = format!("hint: give the drive: {}", drive.display());
        assert!(text.ends_with(&hint), "{text}");
    }
}

#[test]
fn errors_name_a_missing_or_bad_calibration() {
    let root = tempfile::tempdir().unwrap();
    let drive = TinyDrive::default().write(root.path());
    let file = drive.join("../calib_cam_to_cam.txt");
    let good = common::CAM_TO_CAM;
    for (text, expected) in [
        (
            good.replace("P_rect_02", "P_rect_09"),
            "P_rect_02: the file has no such line",
        ),
        (
            good.replace("P_rect_02: 3.600000e+01", "P_rect_02:"),
            "11 numbers, expected 12",
        ),
        (
            good.replace("6.200000e+01 1", "6.25e+01 1"),
            "62.5 is not a size",
        ),
        (
            good.replace("P_rect_02: 3.600000e+01", "P_rect_02: nan"),
            "'nan' is not finite",
        ),
        (
            good.replace("P_rect_02: 3.600000e+01", "P_rect_02: -36"),
            "fx is -36",
        ),
        (
            good.replace("R_rect_00: 9.99", "R_rect_00: x9.99"),
            "is not a number",
        ),
    ] {
        fs::write(&file, text).unwrap();
        let refused = refusal(&drive);
        assert!(
            refused.contains("calib_cam_to_cam.txt") && refused.contains(expected),
            "{refused}"
        );
    }
    fs::write(&file, good).unwrap();
    let velo = drive.join("../calib_velo_to_cam.txt");
    fs::write(&velo, "R: 1 0 0 0 1 0 0 0 2\nT: 0 0 0\n").unwrap();
    let refused = refusal(&drive);
    assert!(
        refused.contains("calib_velo_to_cam.txt: R: is not a rotation"),
        "{refused}"
    );
    fs::remove_file(&velo).unwrap();
    fs::remove_file(&file).unwrap();
    let refused = refusal(&drive);
    assert!(
        refused.contains("calib_cam_to_cam.txt: no such file or folder; it should contain"),
        "{refused}"
    );
}

#[test]
fn errors_name_a_frame_of_another_size_with_both_sizes() {
    let root = tempfile::tempdir().unwrap();
    let drive = TinyDrive::default().write(root.path());
    let image = image::RgbImage::new(40, 20);
    image
        .save(drive.join("image_02/data/0000000004.png"))
        .unwrap();
    let text = refusal(&drive);
    assert!(
        text.contains("frame 4 of") && text.contains("40x20") && text.contains("62x19"),
        "{text}"
    );
}

#[test]
fn errors_name_broken_parts() {
    let root = tempfile::tempdir().unwrap();
    let drive = TinyDrive::default().write(root.path());
    let packet = drive.join("oxts/data/0000000002.txt");
    let good = fs::read_to_string(&packet).unwrap();
    fs::write(&packet, common::packet(f64::NAN, 0.0)).unwrap();
    let text = refusal(&drive);
    assert!(
        text.contains("0000000002.txt: vf (value 9 of 30): NaN"),
        "{text}"
    );
    fs::write(&packet, good).unwrap();

    let stamps = drive.join("image_02/timestamps.txt");
    let good = fs::read_to_string(&stamps).unwrap();
    let few: Vec<&str> = good.lines().take(5).collect();
    fs::write(&stamps, few.join("\n")).unwrap();
    let text = refusal(&drive);
    assert!(
        text.contains("5 time stamps (for frames 0 to 4), but there is a frame 5"),
        "{text}"
    );
    fs::write(&stamps, good.replacen("13:04:00.448", "13:04:aa.448", 1)).unwrap();
    let text = refusal(&drive);
    assert!(text.contains("timestamps.txt:2:"), "{text}");
    fs::write(&stamps, good).unwrap();

    let image = drive.join("image_02/data/0000000006.png");
    let bytes = fs::read(&image).unwrap();
    fs::write(&image, &bytes[..bytes.len() / 2]).unwrap();
    let text = open(&drive).unwrap()[0]
        .load_image(6)
        .unwrap_err()
        .to_string();
    assert!(
        text.contains("0000000006.png: the image is truncated"),
        "{text}"
    );
}

#[test]
fn stray_files_are_ignored_and_png_is_preferred_to_jpeg() {
    let root = tempfile::tempdir().unwrap();
    let drive = TinyDrive::default().write(root.path());
    let data = drive.join("image_02/data");
    fs::write(data.join("._0000000001.png"), "mac").unwrap();
    fs::write(data.join("thumbs.db"), "windows").unwrap();
    fs::write(data.join("0000000002.jpg"), "a second copy").unwrap();
    let datasets = open(&drive).unwrap();
    assert_eq!(datasets[0].frames().len(), 8);
    let second = datasets[0].frames()[2].image.file().unwrap();
    assert!(second.ends_with("0000000002.png"));
}

#[test]
fn an_inspection_counts_everything() {
    let root = tempfile::tempdir().unwrap();
    let drive = TinyDrive {
        frames: vec![0, 1, 2, 4, 5, 7],
        scans: vec![0, 4],
        ..TinyDrive::default()
    }
    .write(root.path());
    let seen = inspect(&drive).unwrap();
    assert_eq!((seen.frames, seen.size), (6, Some([62, 19])));
    assert_eq!(seen.drives[0].missing_frames, [[3, 3], [6, 6]]);
    assert_eq!((seen.drives[0].usable_pairs, seen.drives[0].scans), (3, 2));
    // 7 intervals of 0.103 s at 10 m/s: oxts has no gaps where images are missing.
    assert!((seen.distance_m.unwrap() - 7.21).abs() < 1e-6);
    assert!((seen.duration_s.unwrap() - 0.721).abs() < 1e-9);
    let speed = seen.speed_mps.unwrap();
    assert_eq!((speed.min, speed.max), (10.0, 10.0));
    let stream = |name| seen.streams.iter().find(|s| s.name == name).unwrap();
    assert_eq!((stream("image_02").count, stream("image_02").gaps), (6, 2));
    assert!((stream("oxts").rate_hz.unwrap() - 9.7087).abs() < 1e-3);
    assert_eq!(stream("velodyne_points").count, 2);
    let table = seen.to_string();
    assert!(
        table.contains("missing 3, 6") && table.contains("10.0 m/s"),
        "{table}"
    );

    let json: serde_json::Value = serde_json::to_value(&seen).unwrap();
    for key in [
        "kind",
        "frames",
        "size",
        "intrinsics",
        "streams",
        "speed_mps",
        "distance_m",
        "duration_s",
    ] {
        assert!(json.get(key).is_some(), "{key}");
    }
    assert_eq!(json["kind"], "kitti_raw");
    assert_eq!(json["streams"][0]["type"], "image");
    assert_eq!(json["intrinsics"]["fx"], 36.0);
}

/// An invalid drive does not hide the others of its date, and drives without images of the left camera, which training uses, are named.
#[test]
fn an_inspection_lists_what_cannot_be_read() {
    let root = tempfile::tempdir().unwrap();
    TinyDrive::default().write(root.path());
    let other = |number: u32| {
        let name = format!("2030_01_02/2030_01_02_drive_{number:04}_sync");
        TinyDrive::default().write_as(root.path(), &name)
    };
    let (broken, empty, right) = (other(8), other(9), other(10));
    fs::write(broken.join("image_02/timestamps.txt"), "yesterday\n").unwrap();
    fs::remove_dir_all(empty.join("image_02/data")).unwrap();
    fs::rename(right.join("image_02"), right.join("image_03")).unwrap();
    let seen = inspect(root.path()).unwrap();
    assert_eq!((seen.drives.len(), seen.frames), (1, 8));
    let [unreadable] = seen.unreadable.as_slice() else {
        panic!("{:?}", seen.unreadable)
    };
    assert!(unreadable.path.ends_with("2030_01_02_drive_0008_sync"));
    assert!(matches!(*unreadable.error, Error::TimeStamp { .. }));
    let warnings = text_of(&seen.drives[0].warnings);
    for part in ["of camera 2", "drive_0009_sync", "drive_0010_sync"] {
        assert!(warnings.contains(part), "{part}: {warnings}");
    }
    // Giving a camera for drives with their own calibration is an error of the call, not of a drive.
    let given = OpenOptions {
        hfov_deg: Some(90.0),
        ..OpenOptions::default()
    };
    let error = inspect_with(root.path(), &given, |_| None).unwrap_err();
    assert!(matches!(error, Error::OwnCalibration { .. }), "{error}");
}

/// If no drive has a left camera, the right one is inspected; an error common to all drives is reported once.
#[test]
fn an_inspection_uses_the_right_camera_if_no_drive_has_a_left_one() {
    let root = tempfile::tempdir().unwrap();
    let drives = [7, 8].map(|number| {
        let name = format!("2030_01_02/2030_01_02_drive_{number:04}_sync");
        let drive = TinyDrive {
            cameras: vec![3],
            ..TinyDrive::default()
        };
        drive.write_as(root.path(), &name)
    });
    let seen = inspect(root.path()).unwrap();
    let cameras: Vec<u8> = seen.drives.iter().map(|drive| drive.camera).collect();
    assert_eq!((cameras, seen.frames), (vec![3, 3], 16));
    for drive in &drives {
        fs::remove_dir_all(drive.join("image_03/data")).unwrap();
    }
    let error = inspect(root.path()).unwrap_err();
    assert!(matches!(error, Error::NoImages { .. }), "{error}");
}

#[test]
fn an_inspection_of_images_without_oxts_shows_what_is_unknown() {
    let root = tempfile::tempdir().unwrap();
    let drive = TinyDrive::default().write(root.path());
    fs::remove_dir_all(drive.join("oxts")).unwrap();
    let seen = inspect(&drive).unwrap();
    assert_eq!((seen.speed_mps, seen.distance_m), (None, None));
    let why = seen.drives[0].why_no_pairs.as_ref().unwrap();
    assert!(why.contains("oxts"), "{why}");
    assert!(seen.to_string().contains("speed     unknown"), "{seen}");
}

#[test]
fn the_real_root_opens() {
    let Some(root) = common::real_data("kitti_raw") else {
        return;
    };
    let drives = find_drives(&root).unwrap();
    assert_eq!(drives.len(), 3);
    let seen = inspect(&root).unwrap();
    assert_eq!(seen.frames, 154 + 51 + 1);
    assert!((seen.drives[1].distance_m.unwrap() - 71.302).abs() < 0.001);
    assert!((seen.drives[2].distance_m.unwrap() - 54.628).abs() < 0.001);
    let rate = seen
        .streams
        .iter()
        .find(|s| s.name.ends_with("0005_sync/image_02"));
    assert!((rate.unwrap().rate_hz.unwrap() - 9.67).abs() < 0.02);
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 64, failure_persistence: None, ..ProptestConfig::default() })]
    /// Calibration files with any content are read or refused, without a panic.
    #[test]
    fn calibration_garbage_never_panics(lines in proptest::collection::vec("(S_rect_02|P_rect_02|R_rect_00|R|T): [-0-9. e]{0,60}", 0..6)) {
        let dir = tempfile::tempdir().unwrap();
        for file in [Calibration::CAM_TO_CAM, Calibration::VELO_TO_CAM, Calibration::IMU_TO_VELO] {
            fs::write(dir.path().join(file), lines.join("\n")).unwrap();
        }
        let _ = Calibration::read(dir.path(), Camera::Left);
    }
}
