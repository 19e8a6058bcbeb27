//! Odometry errors against other people's code: evo for pairs and snippets, KITTI's definition in NumPy
//! (`tests/reference/odometry.py`); and the texts of a report.

use std::path::Path;

use deepfusion_eval::odometry::{OdometryReport, PoseFile, TrackPair, kitti_text};
use deepfusion_geometry::Se3;
use deepfusion_hint::Hint;
use serde_json::Value;

fn cases() -> Vec<Value> {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/reference/odometry.json");
    serde_json::from_slice(&std::fs::read(path).unwrap()).unwrap()
}

/// Goes through a file, so that reading is checked too.
fn poses(rows: &Value, folder: &Path) -> Vec<Se3> {
    let line = |row: &Value| -> String {
        let words: Vec<String> = row
            .as_array()
            .unwrap()
            .iter()
            .map(|v| v.as_f64().unwrap().to_string())
            .collect();
        words.join(" ") + "\n"
    };
    let text: String = rows.as_array().unwrap().iter().map(line).collect();
    let path = folder.join("poses.txt");
    std::fs::write(&path, text).unwrap();
    PoseFile::read(&path).unwrap().poses
}

fn track(case: &Value) -> TrackPair {
    let folder = tempfile::tempdir().unwrap();
    let name = case["name"].as_str().unwrap();
    let truth = poses(&case["truth"], folder.path());
    let predicted = poses(&case["predicted"], folder.path());
    TrackPair::new(name, truth, predicted).unwrap()
}

/// The fixture's rotations have ten digits. NumPy uses them unchanged, while a pose projects them onto the nearest rotation. Over 200 m
/// that moves the end by 200 · 1e-9; relative to drifts of some metres that is 1e-7. Near 1, arccos turns the missing digits, 1e-9, into
/// angles of up to √(2 · 1e-9) = 4e-5 rad. The angles of whole stretches are 0.04 rad and more, so they change by 1e-6 of their size. The
/// angles of single pairs, 0.0035 rad, change by 1e-9 / 0.0035², which is 1e-4 of their size.
#[test]
fn numbers_equal_evos_and_kittis() {
    for case in cases() {
        let expected = &case["expected"];
        let report = OdometryReport::of(&[track(&case)], "a file");
        let close = |ours: Option<f64>, field: &str, tolerance: f64| {
            let (ours, theirs) = (ours.unwrap(), expected[field].as_f64().unwrap());
            let off = (ours - theirs).abs() / theirs;
            assert!(off < tolerance, "{field}: {ours} and {theirs}, {off:.1e}");
        };
        close(report.t_rel_percent, "t_rel_percent", 1e-6);
        close(report.r_rel_deg_per_m, "r_rel_deg_per_m", 1e-5);
        close(report.ate_m, "ate_m", 1e-6);
        close(report.ate_scaled_m, "ate_scaled_m", 1e-5);
        close(report.rpe_m, "rpe_m", 1e-6);
        close(report.rpe_deg, "rpe_deg", 1e-4);
        close(report.scale, "scale", 1e-6);
        let lengths = expected["lengths"].as_array().unwrap();
        assert_eq!(report.lengths.len(), lengths.len());
        for (ours, theirs) in report.lengths.iter().zip(lengths) {
            assert_eq!(u64::from(ours.length_m), theirs["length_m"]);
            assert_eq!(ours.n as u64, theirs["n"]);
            let theirs = theirs["t_rel_percent"].as_f64().unwrap();
            assert!((ours.t_rel_percent / theirs - 1.0).abs() < 1e-6);
        }
    }
}

#[test]
fn stretches_of_all_drives_are_pooled() {
    let [long, short] = [0, 1].map(|i| track(&cases()[i]));
    let alone = OdometryReport::of(std::slice::from_ref(&long), "a file");
    let both = OdometryReport::of(&[long, short], "a file");
    // The short drive has no stretch of 100 m: it adds to everything but the drift.
    assert_eq!(both.t_rel_percent, alone.t_rel_percent);
    assert_ne!(both.ate_m, alone.ate_m);
    assert_eq!(both.lengths_m, [100, 200]);
    assert_eq!(both.n, 280);
    assert_eq!(both.drives[1].t_rel_percent, None);
    assert!(both.drives[1].scale.is_some());
}

#[test]
fn json_has_the_promised_fields_and_no_nan() {
    let still = vec![Se3::identity(); 3];
    let track = TrackPair::new("still", still.clone(), still).unwrap();
    let report = OdometryReport::of(&[track], "a file");
    let json = serde_json::to_value(&report).unwrap();
    for field in ["t_rel_percent", "r_rel_deg_per_m", "ate_m", "scale"] {
        assert!(json[field].is_null(), "{field}: {}", json[field]);
    }
    assert_eq!(json["lengths_m"], serde_json::json!([]));
    assert_eq!(
        serde_json::from_value::<OdometryReport>(json).unwrap(),
        report
    );
}

#[test]
fn the_table_for_people() {
    let tracks = [0, 1].map(|i| track(&cases()[i]));
    let report = OdometryReport::of(&tracks, "KITTI's OXTS");
    insta::assert_snapshot!("odometry_of_two_drives", report.to_string());
    let report = OdometryReport::of(&tracks[1..], "exact poses");
    insta::assert_snapshot!("odometry_of_a_short_drive", report.to_string());
}

/// The same trajectory in another world frame scores the same: only motions within a trajectory are compared.
#[test]
fn the_world_frame_does_not_matter() {
    let track = track(&cases()[0]);
    let world = Se3::from_axis_angle([0.3, -1.0, 0.2].into(), [5.0, 6.0, 7.0].into());
    let moved = TrackPair::new(
        "moved",
        track.truth.iter().map(|p| world * *p).collect(),
        track.predicted.clone(),
    )
    .unwrap();
    let (a, b) = (
        OdometryReport::of(&[track], ""),
        OdometryReport::of(&[moved], ""),
    );
    assert!((a.t_rel_percent.unwrap() - b.t_rel_percent.unwrap()).abs() < 1e-9);
    assert!((a.ate_m.unwrap() - b.ate_m.unwrap()).abs() < 1e-9);
}

#[test]
fn a_missing_file_is_named_and_poses_are_written_as_kitti_text() {
    let folder = tempfile::tempdir().unwrap();
    let missing = PoseFile::read(&folder.path().join("none.txt")).unwrap_err();
    assert!(missing.to_string().contains("none.txt"));
    assert!(missing.hint().unwrap().contains("spelling"));
    assert!(kitti_text(&[Se3::identity()]).starts_with("1.000000000000e+00 0.000000000000e+00"));
}
