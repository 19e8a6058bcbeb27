//! comma2k19 segments.

use crate::common;
use deepfusion_data::{Dataset, DatasetKind, Error, OpenOptions, inspect};
use deepfusion_hint::Hint;
use ndarray::{Array1, Array2};
use ndarray_npy::WriteNpyExt;
use std::fs;
use std::path::Path;

/// A segment without video: 41 frames at 20 Hz from 100 s on, accelerating at 2 m/s² from 5 m/s.
fn write_segment(folder: &Path) {
    let speed = folder.join("processed_log/CAN/speed");
    fs::create_dir_all(&speed).unwrap();
    fs::create_dir_all(folder.join("global_pose")).unwrap();
    let t = Array1::from_iter((0..250).map(|i| 100.0 - 0.1 + f64::from(i) * 0.01));
    let v = Array2::from_shape_fn((250, 1), |(i, _)| 5.0 + 2.0 * (t[i] - 100.0));
    let write = |path: &Path, array: &dyn Fn(fs::File)| array(fs::File::create(path).unwrap());
    write(&speed.join("t"), &|f| t.write_npy(f).unwrap());
    write(&speed.join("value"), &|f| v.write_npy(f).unwrap());
    let frames = Array1::from_iter((0..41).map(|i| 100.0 + f64::from(i) * 0.05));
    let times = folder.join("global_pose/frame_times");
    write(&times, &|f| frames.write_npy(f).unwrap());
}

#[test]
fn a_segment_without_its_video_is_inspected_but_not_opened() {
    let root = tempfile::tempdir().unwrap();
    write_segment(root.path());
    let seen = inspect(root.path()).unwrap();
    assert_eq!(
        (seen.kind, seen.frames, seen.size),
        (DatasetKind::Comma2k19, 0, None)
    );
    // 2 s from 5 to 9 m/s.
    assert!(
        (seen.distance_m.unwrap() - 14.0).abs() < 1e-6,
        "{:?}",
        seen.distance_m
    );
    assert!((seen.duration_s.unwrap() - 2.0).abs() < 1e-9);
    assert!((seen.speed_mps.unwrap().max - 9.0).abs() < 1e-9);
    let stream = |name: &str| {
        seen.streams
            .iter()
            .find(|s| s.name.ends_with(name))
            .unwrap()
    };
    assert!((stream("CAN/speed").rate_hz.unwrap() - 100.0).abs() < 1e-6);
    assert!((stream("frame_times").rate_hz.unwrap() - 20.0).abs() < 1e-6);
    // With a clock that is 0.1 s ahead, frames are 0.1 s earlier. The scale only applies to the speed.
    let config = root.path().join("dataset.toml");
    fs::write(
        &config,
        "clock.camera_ahead_s = 0.1\nvehicle.speed_scale = 0.5\n",
    )
    .unwrap();
    let shifted = inspect(root.path()).unwrap().speed_mps.unwrap();
    assert!((shifted.max - 0.5 * 8.8).abs() < 1e-9, "{shifted:?}");
    fs::remove_file(&config).unwrap();
    let text = seen.to_string();
    assert!(
        text.starts_with("comma2k19 segment without images"),
        "{text}"
    );
    let json = serde_json::to_value(&seen).unwrap();
    assert!(json["size"].is_null() && json["intrinsics"].is_null());

    let error = Dataset::open(root.path(), &OpenOptions::default()).unwrap_err();
    assert!(matches!(error, Error::NoSegmentVideo { .. }), "{error}");
    assert!(
        error
            .to_string()
            .contains("video.hevc: no such file or folder; it should contain")
    );
    assert!(error.hint().unwrap().contains("fetch video.hevc"));
}

/// Ten seconds at 8 m/s and 0.2 rad/s to the left: gyroscope and accelerometer in the device's axes (forward, right,
/// down), the steering wheel at 0.2 · 2.7 / 8 rad times a ratio of 15.
#[test]
fn gyroscope_and_steering_give_a_segments_turns() {
    let root = tempfile::tempdir().unwrap();
    let log = root.path().join("processed_log");
    let t = Array1::from_iter((0..1001).map(|i| 100.0 + f64::from(i) * 0.01));
    let write = |name: &str, columns: &[f64]| {
        let folder = log.join(name);
        fs::create_dir_all(&folder).unwrap();
        let rows = Array2::from_shape_fn((t.len(), columns.len()), |(_, i)| columns[i]);
        t.write_npy(fs::File::create(folder.join("t")).unwrap())
            .unwrap();
        rows.write_npy(fs::File::create(folder.join("value")).unwrap())
            .unwrap();
    };
    write("CAN/speed", &[8.0]);
    write("IMU/gyro", &[0.0, 0.0, -0.2]);
    write("IMU/accelerometer", &[0.0, -1.6, -9.81]);
    fs::create_dir_all(root.path().join("global_pose")).unwrap();
    let frames = Array1::from_iter((0..21).map(|i| 102.0 + f64::from(i) * 0.2));
    let times = fs::File::create(root.path().join("global_pose/frame_times")).unwrap();
    frames.write_npy(times).unwrap();
    let turned = || {
        let seen = inspect(root.path()).unwrap();
        (seen.drives[0].turn_rad, seen.distance_m.unwrap())
    };
    // Four seconds.
    let (by_gyro, distance) = turned();
    assert!((by_gyro.unwrap() - 0.8).abs() < 0.02, "{by_gyro:?}");
    assert!((distance - 32.0).abs() < 0.3, "{distance}");

    fs::remove_dir_all(log.join("IMU")).unwrap();
    write(
        "CAN/steering_angle",
        &[(0.2_f64 * 2.7 / 8.0).atan().to_degrees() * 15.0],
    );
    assert_eq!(turned().0, None, "the wheelbase is unknown");
    let vehicle = "[vehicle]\nwheelbase_m = 2.7\nsteering_ratio = 15.0\n";
    fs::write(root.path().join("dataset.toml"), vehicle).unwrap();
    let by_steering = turned().0;
    assert!((by_steering.unwrap() - 0.8).abs() < 0.02, "{by_steering:?}");
}

#[test]
fn broken_arrays_are_named() {
    let root = tempfile::tempdir().unwrap();
    write_segment(root.path());
    let value = root.path().join("processed_log/CAN/speed/value");
    let bytes = fs::read(&value).unwrap();
    // The header announces more values than the file has.
    fs::write(&value, &bytes[..bytes.len() - 8]).unwrap();
    let error = inspect(root.path()).unwrap_err();
    assert!(error.to_string().contains("speed/value"), "{error}");
    fs::write(&value, "not an array").unwrap();
    assert!(inspect(root.path()).is_err());
    let short = Array1::from_elem(3, 1.0);
    short.write_npy(fs::File::create(&value).unwrap()).unwrap();
    let error = inspect(root.path()).unwrap_err().to_string();
    assert!(error.contains("3 values, but t has 250"), "{error}");
}

/// By NumPy: the trapezoidal rule over CAN speed with its values interpolated at the frames' times (1003.2599 m),
/// and its range there.
#[test]
fn the_real_segment_is_inspected() {
    let Some(folder) = common::real_data("comma/Example_1_seg40") else {
        return;
    };
    let seen = inspect(&folder).unwrap();
    assert!((seen.duration_s.unwrap() - 59.949_158).abs() < 1e-5);
    let speed = seen.speed_mps.unwrap();
    assert!(
        (speed.min - 7.974_306).abs() < 1e-5 && (speed.max - 19.832_877).abs() < 1e-5,
        "{speed:?}"
    );
    assert!(
        // The inertial unit's drift over a minute contributes with a weight of 0.1 / 60².
        (seen.distance_m.unwrap() - 1003.2599).abs() < 5e-3,
        "{:?}",
        seen.distance_m
    );
    assert_eq!(seen.streams.len(), 6);
}
