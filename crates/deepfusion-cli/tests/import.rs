//! A drive whose speeds an app has logged: imported with `data import`, and read in place.

use std::fs;
use std::path::Path;

use crate::support::{fails, json, ok};
use serde_json::Value;

const DRIVE: &str = "sim/2026_01_01/2026_01_01_drive_0003_sync";

/// A simulated drive's images with their times, and its speeds as Torque writes them: the log's lines, and the inspection of the drive
/// itself.
fn write_drive(at: &Path) -> (Vec<String>, Value) {
    ok(
        at,
        "simulate --out sim --frames 24 --seed 3 --size 160x96 --scan-every 12",
    );
    let truth = json(at, "data inspect sim --json");
    let drive = at.join(DRIVE);
    fs::rename(drive.join("image_02/data"), at.join("images")).unwrap();
    let stamps = fs::read_to_string(drive.join("image_02/timestamps.txt")).unwrap();
    let seconds = |stamp: &str| {
        // "2026-01-01 12:00:00.100245935"; noon is 1767268800.
        let clock: Vec<f64> = stamp[11..]
            .split(':')
            .map(|part| part.parse().unwrap())
            .collect();
        1_767_225_600.0 + clock[0] * 3600.0 + clock[1] * 60.0 + clock[2]
    };
    let mut frames = "time_s,file\n".to_owned();
    let mut log = vec!["GPS Time,Device Time, Longitude,Speed (OBD)(km/h)".to_owned()];
    for (i, stamp) in stamps.lines().enumerate() {
        frames += &format!("{:.6},{i:010}.png\n", seconds(stamp));
        let oxts = fs::read_to_string(drive.join(format!("oxts/data/{i:010}.txt"))).unwrap();
        let mps: f64 = oxts.split_whitespace().nth(8).unwrap().parse().unwrap();
        // The phone's clock is an hour ahead of UTC; every fifth answer of the car is missing.
        let clock = stamp[11..23].replacen("12:", "13:", 1);
        let speed = if i % 5 == 4 {
            "-".to_owned()
        } else {
            format!("{:.4}", mps * 3.6)
        };
        log.push(format!(
            "Thu Jan 01 12:00:00 GMT+00:00 2026,01-Jan-2026 {clock},8.4,{speed}"
        ));
    }
    fs::write(at.join("frames.csv"), frames).unwrap();
    fs::write(at.join("torque.csv"), log.join("\n")).unwrap();
    (log, truth)
}

#[test]
fn a_log_beside_its_images_is_a_drive() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    let (log, truth) = write_drive(at);
    let import = "data import torque.csv --zone +01:00 --images images --intrinsics 92.95,184.71,78.09,43.88";
    let made = ok(at, &format!("{import} --out drive"));
    assert!(
        made.stderr
            .contains("speed from column 'Speed (OBD)(km/h)' in km/h"),
        "{}",
        made.stderr
    );
    assert!(!made.stderr.contains("still to do"), "{}", made.stderr);
    let no_camera = "data import torque.csv --zone +01:00 --images images --out no-camera";
    let printed = ok(at, no_camera).stderr;
    assert!(
        printed.contains("no calibration of its camera"),
        "{printed}"
    );
    assert!(printed.contains("hfov_deg = 70"), "{printed}");
    fs::create_dir(at.join("empty")).unwrap();
    let no_images = "data import torque.csv --zone +01:00 --images empty --hfov 70 --out no-images";
    let printed = ok(at, no_images).stderr;
    assert!(printed.contains("still to do"), "{printed}");
    assert!(printed.contains("no image (.png"), "{printed}");
    fs::copy(at.join("frames.csv"), at.join("drive/frames.csv")).unwrap();
    let imported = json(at, "data inspect drive --json");
    let mean = |inspection: &Value| inspection["speed_mps"]["mean"].as_f64().unwrap();
    assert!(
        (mean(&imported) - mean(&truth)).abs() < 0.02,
        "{} {}",
        mean(&imported),
        mean(&truth)
    );
    let pairs = imported["drives"][0]["usable_pairs"].as_u64().unwrap();
    assert!(pairs >= 20, "{imported}");

    // The same log instead of speed.csv, by dataset.toml alone; its clock is taken for UTC, so the frames are shifted.
    fs::create_dir(at.join("beside")).unwrap();
    fs::copy(at.join("frames.csv"), at.join("beside/frames.csv")).unwrap();
    let config = "images = \"../images\"\nspeed = \"../torque.csv\"\nintrinsics = [92.95, 184.71, 78.09, 43.88]\nstart_s = 1767272400.0\n";
    fs::write(at.join("beside/dataset.toml"), config).unwrap();
    let beside = json(at, "data inspect beside --json");
    assert!((mean(&beside) - mean(&imported)).abs() < 1e-4);
    let warnings = beside["drives"][0]["remarks"].to_string();
    assert!(warnings.contains("assuming UTC"), "{warnings}");

    // The camera by its field of view, 160 pixels of 90 degrees; as an option, too.
    let import_by_view = "data import torque.csv --zone +01:00 --images images";
    ok(at, &format!("{import_by_view} --hfov 90 --out seen"));
    fs::copy(at.join("frames.csv"), at.join("seen/frames.csv")).unwrap();
    let config = fs::read_to_string(at.join("seen/dataset.toml")).unwrap();
    assert!(config.contains("hfov_deg = 90.0\n"), "{config}");
    let printed = ok(at, "data inspect seen").stdout;
    assert!(printed.contains("fx 80.0"), "{printed}");
    let printed = ok(at, "data inspect beside --hfov 120");
    assert!(printed.stdout.contains("fx 46.19"), "{}", printed.stdout);
    assert!(!printed.stderr.contains("radians"), "{}", printed.stderr);
    let in_radians = ok(at, "data inspect beside --hfov 1.2").stderr;
    assert!(in_radians.contains("--hfov 69 if"), "{in_radians}");

    fails(at, &format!("{import} --out drive"), &["speed.csv"]);
    fails(
        at,
        "data import torque.csv --video none.mp4 --out x",
        &["none.mp4"],
    );
    fails(
        at,
        "data import torque.csv --out x",
        &["no video and no images"],
    );
    fs::write(at.join("torque.csv"), log.join("\n").replace("(km/h)", "")).unwrap();
    fails(
        at,
        "data import torque.csv --images images --out x",
        &["the unit of the speed", "Speed (OBD)"],
    );
    fails(
        at,
        "data import torque.csv --time when --images images --out x",
        &["no column 'when'", "Device Time"],
    );
    assert!(!at.join("x").exists());
}
