//! The file beside a bag, written from what was found.

use super::common::{Drive, assert_contains, camera, open, open_with, reference};
use crate::common::bag::CAMERA;
use deepfusion_data::{Dataset, Error, OpenOptions, write_bag_config};
use nalgebra::{Matrix3, Vector3};
use std::fs;

#[test]
fn the_written_file_has_what_was_found() {
    let folder = tempfile::tempdir().unwrap();
    let bag = folder.path().join("drive.bag");
    fs::copy(reference("drive.bag"), &bag).unwrap();
    let before = open(&bag).unwrap();
    let written = write_bag_config(&bag, &OpenOptions::default(), false).unwrap();
    assert_eq!(written, [bag.with_extension("toml")]);
    let text = fs::read_to_string(&written[0]).unwrap();
    assert_contains(
        &text,
        &[
            "image = \"/camera/front/image_raw/compressed\"   # sensor_msgs/CompressedImage, 51 messages",
            "speed = \"/gnss/fix\"",
            "[cam_from_vehicle]   # frames base_link → roof_rack",
            "# The camera is taken from CameraInfo.",
            "# wheelbase_m = 2.7",
        ],
    );
    let after = open(&bag).unwrap();
    for (a, b) in before.mounts().iter().zip(after.mounts()) {
        assert_eq!(a.name, b.name);
        let same = |a: [f64; 3], b: [f64; 3]| (Vector3::from(a) - Vector3::from(b)).norm() < 1e-12;
        assert!(
            same(a.translation, b.translation) && same(a.rotation, b.rotation),
            "{}",
            a.name
        );
        assert!(b.source.ends_with("drive.toml"), "{}", b.source);
    }
    assert_eq!(before.mounts().len(), 3);
    assert_eq!(
        before.warnings(),
        after.warnings(),
        "there are no contradictions"
    );
    let speeds = |dataset: &Dataset| -> Vec<Option<f64>> {
        dataset.frames().iter().map(|f| f.speed_mps).collect()
    };
    assert_eq!(speeds(&before), speeds(&after));

    // An existing file is only overwritten on request, and its settings are kept.
    let error = write_bag_config(&bag, &OpenOptions::default(), false).unwrap_err();
    assert!(matches!(error, Error::Exists { .. }), "{error}");
    let edited = format!("scenario = \"urban\"\n{text}\n[vehicle]\nwheelbase_m = 2.9\n");
    fs::write(&written[0], edited).unwrap();
    let options = OpenOptions {
        intrinsics: Some([70.0, 71.0, 48.0, 32.0]),
        camera_ahead_s: Some(0.02),
        topics: vec!["speed=/gnss/fix".parse().unwrap()],
        ..OpenOptions::default()
    };
    write_bag_config(&bag, &options, true).unwrap();
    let text = fs::read_to_string(&written[0]).unwrap();
    assert_contains(
        &text,
        &[
            "scenario = \"urban\"",
            "wheelbase_m = 2.9",
            "fx = 70.0",
            "camera_ahead_s = 0.02",
            "# as before in this file",
        ],
    );
    let again = open(&bag).unwrap();
    assert_eq!(
        (again.intrinsics(0).fx, again.camera_ahead_s()),
        (70.0, 0.02)
    );
    assert_eq!(again.scenario(), Some("urban"));
}

#[test]
fn a_named_topic_replaces_a_signal() {
    let can = "[can]\nspeed_unit = \"km/h\"\n\
        speed = { id = 0x158, layout = { start_bit = 7, length = 16, byte_order = \"motorola\", scale = 0.01 } }\n";
    let drive = Drive::bare(&format!("{CAMERA}{can}"), |bag| {
        let frame = deepfusion_rosbag::msg::Frame {
            id: 0x158,
            dlc: 8,
            // 36 km/h.
            data: [0x0e, 0x10, 0, 0, 0, 0, 0, 0],
            ..Default::default()
        };
        bag.images("/image")
            .can("/can", &frame)
            .twist("/twist", 5.0);
    });
    let speed = |dataset: Dataset| dataset.frames()[12].speed_mps.unwrap();
    assert!((speed(drive.opened()) - 10.0).abs() < 1e-3);
    let topics = ["speed=/twist"];
    assert!((speed(open_with(&drive.bag, &topics).unwrap()) - 5.0).abs() < 1e-3);
    let options = OpenOptions {
        topics: vec![topics[0].parse().unwrap()],
        ..OpenOptions::default()
    };
    write_bag_config(&drive.bag, &options, true).unwrap();
    assert!((speed(drive.opened()) - 5.0).abs() < 1e-3);
    // If no topic is named, the signal is kept.
    let sidecar = drive.bag.with_extension("toml");
    fs::write(&sidecar, format!("{CAMERA}{can}")).unwrap();
    write_bag_config(&drive.bag, &OpenOptions::default(), true).unwrap();
    assert!((speed(drive.opened()) - 10.0).abs() < 1e-3);
}

#[test]
fn unknown_values_are_left_to_be_filled_in() {
    let drive = Drive::bare("", |bag| {
        bag.images("/image").twist("/speed", 10.0);
    });
    let options = OpenOptions {
        intrinsics: Some([60.0, 60.0, 32.0, 24.0]),
        ..OpenOptions::default()
    };
    let written = write_bag_config(&drive.bag, &options, false).unwrap();
    let text = fs::read_to_string(&written[0]).unwrap();
    assert_contains(&text, &["# [cam_from_vehicle]", "[camera]"]);
    // The given camera is kept, and the commented lines are a valid transform once uncommented.
    assert_eq!(drive.opened().intrinsics(0).fx, 60.0);
    let (head, place) = text.split_once("# [cam_from_vehicle]").unwrap();
    let (place, rest) = place.split_once("\n\n").unwrap();
    let place = place.replace("\n# ", "\n");
    fs::write(
        &written[0],
        format!("{head}[cam_from_vehicle]{place}\n\n{rest}"),
    )
    .unwrap();
    let dataset = drive.opened();
    let cam_from_vehicle = dataset.cam_from_vehicle().unwrap();
    let axes = Matrix3::new(0.0, -1.0, 0.0, 0.0, 0.0, -1.0, 1.0, 0.0, 0.0);
    assert!((cam_from_vehicle.rotation() - axes).abs().max() < 1e-4);
    let (place, _) = camera(&dataset);
    assert!(
        (place - Vector3::new(1.6, 0.0, 1.2)).norm() < 1e-3,
        "{place}"
    );

    let folder = tempfile::tempdir().unwrap();
    let picture = deepfusion_data::RgbImage::new(8, 8);
    deepfusion_data::save_png(&picture, &folder.path().join("0.png")).unwrap();
    let error = write_bag_config(folder.path(), &OpenOptions::default(), false).unwrap_err();
    assert!(matches!(error, Error::NotABag { .. }), "{error}");
}
