//! A drive with an unknown camera: trained on, and predicted with the trained network.

use std::fmt::Write as _;
use std::fs;
use std::path::Path;

use crate::support::{self, fails, json, ok};
use serde_json::Value;

/// A simulated KITTI drive as images with speeds and yaw rates, without a calibration.
fn without_camera(kitti: &Path, folder: &Path) {
    let drive = kitti.join("2026_01_01/2026_01_01_drive_0003_sync");
    fs::create_dir_all(folder.join("images")).unwrap();
    let mut speeds = "time_s,speed_mps,yaw_rate_radps\n".to_owned();
    let mut frames: Vec<_> = fs::read_dir(drive.join("oxts/data"))
        .unwrap()
        .map(|entry| entry.unwrap().path())
        .collect();
    frames.sort();
    for (i, oxts) in frames.iter().enumerate() {
        let name = oxts.file_stem().unwrap().to_string_lossy().into_owned();
        let image = drive.join(format!("image_02/data/{name}.png"));
        fs::copy(image, folder.join(format!("images/{name}.png"))).unwrap();
        let text = fs::read_to_string(oxts).unwrap();
        let values: Vec<f64> = text
            .split_whitespace()
            .map(|v| v.parse().unwrap())
            .collect();
        // vf, and wu.
        let _ = writeln!(speeds, "{},{},{}", 0.2 * i as f64, values[8], values[22]);
    }
    fs::write(folder.join("speed.csv"), speeds).unwrap();
    fs::write(folder.join("dataset.toml"), "fps = 5\n").unwrap();
}

fn read(path: &Path) -> Value {
    serde_json::from_str(&fs::read_to_string(path).unwrap()).unwrap()
}

#[test]
fn a_drive_without_a_calibration_is_trained_on_and_predicted() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    ok(
        at,
        "simulate --out sim --frames 16 --fps 5 --seed 3 --size 320x96 --scan-every 0",
    );
    without_camera(&at.join("sim"), &at.join("drive"));
    // The error of a missing camera ends its hint with this option, after those that every command has.
    for command in ["data inspect drive", "train --data drive --steps 2"] {
        let ways = ["hfov_deg = 70", "calibration.yaml", "--intrinsics learn"];
        fails(at, command, &ways);
    }
    let doctor = support::run(at, "doctor drive");
    assert!(
        doctor.stdout.contains("--intrinsics learn"),
        "{}",
        doctor.stdout
    );
    fails(
        at,
        "train --data sim --intrinsics learn --steps 2",
        &["its camera is known", "leave out --intrinsics learn"],
    );

    let train = "train --data drive --preset tiny --size 96x64 --batch 2 --init none --steps 2";
    let options = "--intrinsics learn --view-motion vehicle --set assumed_camera.hfov_deg=70";
    let run = ok(at, &format!("{train} {options} --out run"));
    for part in ["assuming fx", "camera learned: fx", "pixels of 320x96"] {
        assert!(run.stderr.contains(part), "no `{part}` in {}", run.stderr);
    }
    let config: toml::Table = fs::read_to_string(at.join("run/config.toml"))
        .unwrap()
        .parse()
        .unwrap();
    let found = &config["findings"];
    let fx = found["camera"]["fx"].as_float().unwrap();
    // 70 degrees, and two small steps.
    let start = 160.0 / 35.0_f64.to_radians().tan();
    assert!(
        (fx / start - 1.0).abs() < 0.02 && fx != start,
        "{fx} {start}"
    );
    assert_eq!(found["learned_camera"]["focal_px"][0].as_float(), Some(fx));
    ok(at, "train --out run --resume --intrinsics learn --steps 3");

    // The recording has no calibration: the learned camera is used, and recorded as not known.
    let predicted = ok(at, "predict --model run/last.safetensors drive --out depth");
    assert!(predicted.stderr.contains("learned"), "{}", predicted.stderr);
    let sidecar = read(&at.join("depth/0000000003.json"));
    assert_eq!(sidecar["camera_known"], false);
    assert_eq!(sidecar["intrinsics_from"], "learned");
    assert_eq!(sidecar["focal_factor"], 1.0);
    let config: toml::Table = fs::read_to_string(at.join("run/config.toml"))
        .unwrap()
        .parse()
        .unwrap();
    let last = config["findings"]["camera"]["fx"].as_float().unwrap();
    let used = sidecar["intrinsics"][0].as_f64().unwrap();
    assert!(
        (used / last - 1.0).abs() < 1e-9 && last != fx,
        "{used} {last} {fx}"
    );
    // A camera that is given is known.
    ok(
        at,
        "predict --model run drive --intrinsics 186,185,157,44 --out given",
    );
    let given = read(&at.join("given/0000000003.json"));
    assert_eq!(given["camera_known"], true);
    // A picture of unknown origin is assumed to be from this camera.
    ok(
        at,
        "predict --model run drive/images/0000000003.png --out picture",
    );
    let picture = read(&at.join("picture/0000000003.json"));
    assert_eq!(picture["camera_known"], false);
    assert_eq!(picture["intrinsics_from"], "learned");

    let report = json(
        at,
        "eval --model run/last.safetensors --data drive --assume-unseen --json",
    );
    let focal_px = report["checkpoint"]["learned_camera"]["focal_px"][0].as_f64();
    // JSON parsers may differ in the last digit.
    assert!(
        focal_px.is_some_and(|f| (f - last).abs() < 1e-9),
        "{focal_px:?} {last}"
    );

    // A network whose run had calibrated cameras has no learned one.
    ok(
        at,
        "train --data sim --preset tiny --size 96x64 --batch 2 --init none --steps 1 --out known",
    );
    fails(
        at,
        "predict --model known drive --out nothing",
        &["calibration.yaml"],
    );
}
