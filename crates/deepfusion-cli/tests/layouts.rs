//! KITTI's odometry benchmark through the program. The other layouts are tested in `deepfusion-data`.

use std::collections::HashMap;
use std::fs;
use std::path::Path;

use crate::support::{json, ok};

/// Writes the simulator's drive below `sim` as sequence 09 below `odometry`.
fn as_sequence(at: &Path, frames: usize) {
    let date = at.join("sim/2026_01_01");
    let drive = date.join("2026_01_01_drive_0003_sync");
    let sequence = at.join("odometry/sequences/09");
    for folder in ["image_2", "velodyne"] {
        fs::create_dir_all(sequence.join(folder)).unwrap();
    }
    for i in 0..frames {
        for (from, to, ending) in [
            ("image_02", "image_2", "png"),
            ("velodyne_points", "velodyne", "bin"),
        ] {
            let file = drive.join(format!("{from}/data/{i:010}.{ending}"));
            if file.is_file() {
                fs::copy(file, sequence.join(format!("{to}/{i:06}.{ending}"))).unwrap();
            }
        }
    }
    let fields = |file: &str| -> HashMap<String, Vec<String>> {
        let text = fs::read_to_string(date.join(file)).unwrap();
        let field = |line: &str| {
            let (key, values) = line.split_once(": ")?;
            let words = values.split_whitespace().map(str::to_owned);
            Some((key.to_owned(), words.collect()))
        };
        text.lines().filter_map(field).collect()
    };
    let (cameras, velo) = (
        fields("calib_cam_to_cam.txt"),
        fields("calib_velo_to_cam.txt"),
    );
    let row = |i: usize| [&velo["R"][3 * i..3 * i + 3], &velo["T"][i..=i]].concat();
    let tr = [row(0), row(1), row(2)].concat().join(" ");
    let calib = format!("P2: {}\nTr: {tr}\n", cameras["P_rect_02"].join(" "));
    fs::write(sequence.join("calib.txt"), calib).unwrap();
    // The simulator's time stamps begin at noon.
    let stamps = fs::read_to_string(drive.join("image_02/timestamps.txt")).unwrap();
    let seconds = stamps.lines().map(|l| l.rsplit_once(':').unwrap().1);
    let times: String = seconds.map(|s| format!("{s}\n")).collect();
    fs::write(sequence.join("times.txt"), times).unwrap();
    // The poses are camera 2's, 6 cm beside camera 0: too close for the street's turns to distinguish.
    fs::create_dir_all(at.join("odometry/poses")).unwrap();
    fs::copy(drive.join("poses.txt"), at.join("odometry/poses/09.txt")).unwrap();
}

#[test]
fn a_sequence_is_trained_on_and_evaluated() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    ok(
        at,
        "simulate --out sim --frames 16 --seed 3 --scan-every 4 --size 160x96",
    );
    as_sequence(at, 16);
    // Sequence 09 as Monodepth2 names it.
    let lines: String = (1..15).map(|n| format!("9 {n} l\n")).collect();
    fs::write(at.join("train.txt"), lines).unwrap();
    fs::write(at.join("test.txt"), "9 4 l\n9 8 l\n").unwrap();
    ok(
        at,
        "train --data odometry --split train.txt --size 96x64 --batch 2 --steps 1 --init none --out run",
    );
    let data = "--data odometry";
    let inspected = json(at, "data inspect odometry --json");
    let raw = json(at, "data inspect sim --json");
    assert_eq!(inspected["kind"], "kitti_odometry");
    assert_eq!(inspected["drives"][0]["scans"], 4);
    // The distance from the derivative of the poses agrees with the simulator's OXTS.
    for field in ["distance_m", "duration_s"] {
        let [a, b] = [&inspected, &raw].map(|seen| seen[field].as_f64().unwrap());
        assert!((a / b - 1.0).abs() < 3e-3, "{field}: {a} and {b}");
    }
    let report = json(
        at,
        &format!("eval --model run {data} --split test.txt --strict --json"),
    );
    assert_eq!((&report["n"], &report["expected"]), (&2.into(), &2.into()));
    // In either layout, the true path is the same.
    let odometry = "eval-odometry --model run --json --data";
    let own = json(at, &format!("{odometry} odometry"));
    let exact = json(at, &format!("{odometry} sim"));
    assert_eq!(own["truth"], "the recordings' own poses");
    assert_eq!(own["n"], 16);
    let way = |report: &serde_json::Value| report["distance_m"].as_f64().unwrap();
    assert!((way(&own) / way(&exact) - 1.0).abs() < 1e-2, "{own}");
    let sidecars = json(
        at,
        "predict --model run odometry/sequences/09 --out depth --json",
    );
    assert_eq!(sidecars.as_array().unwrap().len(), 16);
    assert_eq!(sidecars[0]["intrinsics_from"], "recording");
}

/// A warning about files that are not read names the folder, not one of its drives.
#[test]
fn files_that_are_not_read_are_reported_for_the_folder() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    ok(at, "simulate --out sim --frames 6 --size 96x64");
    fs::write(at.join("sim/drive.mp4"), "").unwrap();
    let printed = ok(at, "data convert sim copy").stderr;
    let about = printed.lines().filter(|line| line.contains("drive.mp4"));
    let about: Vec<&str> = about.collect();
    assert_eq!(about.len(), 1, "{printed}");
    let expected =
        "sim is read only as KITTI raw; drive.mp4 in it looks like a recording and is not read";
    assert!(about[0].contains(expected), "{printed}");
    assert!(!about[0].contains("_sync"), "{printed}");
}
