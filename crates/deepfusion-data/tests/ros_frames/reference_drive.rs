//! A complete drive written by another program, with known ground truth.

use super::common::{assert_contains, open, reference};
use crate::common::text_of;
use deepfusion_data::{Dataset, GtKind, inspect};
use deepfusion_geometry::Se3;
use nalgebra::{Matrix4, Vector3};
use serde::Deserialize;
use std::fs;

/// Ground truth of the drive, from `reference/ros_drive.py`.
#[derive(Deserialize)]
struct DriveFacts {
    cam_from_vehicle: [[f64; 4]; 4],
    cam_from_lidar: [[f64; 4]; 4],
    vehicle_from_imu: [[f64; 4]; 4],
    /// Times in nanoseconds and speeds in m/s, along the exact path.
    speeds: Vec<(i64, f64)>,
    images: usize,
}

fn facts() -> DriveFacts {
    serde_json::from_str(&fs::read_to_string(reference("drive.json")).unwrap()).unwrap()
}

/// The chain of quaternions is exact up to rounding; the file's own transforms have 16 digits.
fn is_transform(found: &Se3, expected: &[[f64; 4]; 4], what: &str) {
    let expected = Matrix4::from_fn(|r, c| expected[r][c]);
    let apart = (found.matrix() - expected).abs().max();
    assert!(apart < 1e-9, "{what}: {apart}");
}

/// Mounts agree with SciPy's, and speeds with those of the path from which the positions were computed.
fn is_the_drive(dataset: &Dataset, known: &DriveFacts) {
    let mount = |name: &str| {
        let mount = dataset.mounts().iter().find(|m| m.name == name).unwrap();
        assert!(mount.source.starts_with("frames "), "{mount:?}");
        Se3::from_axis_angle(
            Vector3::from(mount.rotation),
            Vector3::from(mount.translation),
        )
    };
    let name = "cam_from_vehicle";
    is_transform(&mount(name), &known.cam_from_vehicle, name);
    let used = dataset.cam_from_vehicle().unwrap();
    is_transform(&used, &known.cam_from_vehicle, "used");
    let name = "vehicle_from_imu";
    is_transform(&mount(name), &known.vehicle_from_imu, name);

    // 1 Hz with linear interpolation: over the whole drive and at each frame.
    let origin_ns = dataset.origin_ns().unwrap();
    let speed_at = |time_s: f64| {
        let ns = origin_ns + (time_s * 1e9).round() as i64;
        let after = known.speeds.partition_point(|s| s.0 < ns);
        known.speeds[after.min(known.speeds.len() - 1)].1
    };
    let frames = dataset.frames().iter();
    let pairs: Vec<(f64, f64)> = frames
        .filter_map(|f| Some((f.speed_mps?, speed_at(f.time_s?))))
        .collect();
    // The last position is at 9 s, but the drive ends at 10 s.
    let after = dataset.frames().iter().filter(|f| f.time_s > Some(9.1));
    assert_eq!(pairs.len() + after.count(), dataset.frames().len());
    let of = |part: fn(&(f64, f64)) -> f64| pairs.iter().map(part).sum::<f64>();
    let ratio = of(|p| p.0) / of(|p| p.1);
    assert!((ratio - 1.0).abs() < 0.01, "{ratio}");
    // The vehicle brakes at 1.7 m/s² where the positions end, which they cannot show.
    let rms = (of(|p| (p.0 - p.1).powi(2)) / pairs.len() as f64).sqrt();
    assert!(rms < 0.5, "{rms} m/s");

    let warnings = text_of(dataset.warnings());
    assert!(!warnings.contains("not given"), "{warnings}");
    assert_contains(
        &warnings,
        &[
            "/gnss/fix: 1 of 10 messages left out for lack of a position",
            "median standard deviation of 0.",
            "interpolated linearly across 8 gaps",
        ],
    );
}

#[test]
fn a_drive_needs_no_file_beside_it() {
    let known = facts();
    let dataset = open(&reference("drive.bag")).unwrap();
    is_the_drive(&dataset, &known);
    assert_eq!(dataset.frames().len(), known.images);
    let lidar = dataset.mounts().iter().find(|m| m.name == "cam_from_lidar");
    let lidar = lidar.unwrap();
    let found = Se3::from_axis_angle(
        Vector3::from(lidar.rotation),
        Vector3::from(lidar.translation),
    );
    is_transform(&found, &known.cam_from_lidar, "cam_from_lidar");
    let truths = (0..dataset.frames().len()).filter(|i| dataset.has_ground_truth(*i, GtKind::Z));
    assert!(truths.count() >= 10);

    let seen = inspect(&reference("drive.bag")).unwrap();
    let text = seen.to_string();
    assert_contains(
        &text,
        &[
            "cam_from_vehicle",
            "frames base_link → roof_rack → camera_front_link → camera_front_optical",
        ],
    );
    assert!(seen.drives[0].usable_pairs > 40, "{text}");
}

#[cfg(feature = "ros2")]
#[test]
fn the_same_drive_in_ros_2_needs_no_file_either() {
    is_the_drive(&open(&reference("drive_ros2")).unwrap(), &facts());
}
