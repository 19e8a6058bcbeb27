//! `--clock-offset auto`: a simulated drive whose camera's clock is ahead of its log's by a known time.

use std::fmt::Write as _;
use std::fs;
use std::path::Path;

use crate::support::{fails, ok, run};

const DRIVE: &str = "sim/2026_01_01/2026_01_01_drive_0005_sync";
/// 2026-01-01 00:00 UTC.
const DAY_S: f64 = 1_767_225_600.0;

/// A reading of the simulated inertial unit.
struct Reading {
    time_s: f64,
    latitude: f64,
    longitude: f64,
    mps: f64,
    yaw_radps: f64,
}

/// A simulated drive at ten frames per second: its images in `images`, and the vehicle's measurement at each image's time.
fn drive(at: &Path, frames: usize) -> Vec<Reading> {
    ok(
        at,
        &format!("simulate --out sim --frames {frames} --seed 5 --size 240x144 --scan-every 0"),
    );
    let drive = at.join(DRIVE);
    fs::rename(drive.join("image_02/data"), at.join("images")).unwrap();
    let stamps = fs::read_to_string(drive.join("image_02/timestamps.txt")).unwrap();
    let seconds = |stamp: &str| {
        let clock: Vec<f64> = stamp[11..]
            .split(':')
            .map(|part| part.parse().unwrap())
            .collect();
        DAY_S + clock[0] * 3600.0 + clock[1] * 60.0 + clock[2]
    };
    let reading = |(i, stamp): (usize, &str)| {
        let oxts = fs::read_to_string(drive.join(format!("oxts/data/{i:010}.txt"))).unwrap();
        let numbers: Vec<f64> = oxts
            .split_whitespace()
            .map(|n| n.parse().unwrap())
            .collect();
        Reading {
            time_s: seconds(stamp),
            latitude: numbers[0],
            longitude: numbers[1],
            mps: numbers[8],
            yaw_radps: numbers[22],
        }
    };
    stamps.lines().enumerate().map(reading).collect()
}

/// A folder of the images, with times of a clock that is `ahead_s` ahead of the readings'.
fn folder(at: &Path, name: &str, readings: &[Reading], ahead_s: f64) {
    fs::create_dir(at.join(name)).unwrap();
    let mut frames = String::from("time_s,file\n");
    for (i, reading) in readings.iter().enumerate() {
        let _ = writeln!(frames, "{:.6},{i:010}.png", reading.time_s + ahead_s);
    }
    fs::write(at.join(name).join("frames.csv"), frames).unwrap();
    let config = "images = \"../images\"\nintrinsics = [139.43, 277.07, 117.13, 65.82]\n";
    fs::write(at.join(name).join("dataset.toml"), config).unwrap();
}

/// How far the camera's clock is ahead as printed, and the standard error, in milliseconds.
fn found(printed: &str) -> (f64, f64) {
    let line = printed
        .lines()
        .find(|line| line.contains("the camera's clock is"))
        .unwrap();
    let words: Vec<&str> = line.split_whitespace().collect();
    let at = words.iter().position(|word| *word == "±").unwrap();
    let number = |at: usize| -> f64 { words[at].parse().unwrap() };
    let sign = if words[at + 3] == "behind" { -1.0 } else { 1.0 };
    (sign * number(at - 1), number(at + 1))
}

#[track_caller]
fn is_within(printed: &str, ahead_ms: f64) {
    let (offset, error) = found(printed);
    println!("{ahead_ms}: {offset} ± {error}");
    assert!(
        (offset - ahead_ms).abs() <= (3.0 * error).min(50.0),
        "{printed}"
    );
}

#[test]
fn the_offset_is_found_from_a_gyroscope_and_from_a_track() {
    let temporary = tempfile::tempdir().unwrap();
    let at = temporary.path();
    let readings = drive(at, 900);
    let mut table = String::from("time_s,speed_mps,yaw_rate_radps\n");
    let mut track = String::from("<gpx version=\"1.1\"><trk><trkseg>\n");
    for (i, reading) in readings.iter().enumerate() {
        let _ = writeln!(
            table,
            "{:.6},{:.4},{:.5}",
            reading.time_s, reading.mps, reading.yaw_radps
        );
        if i % 2 == 0 {
            let s = reading.time_s - DAY_S;
            let (hour, minute) = ((s / 3600.0).floor(), (s / 60.0).floor() % 60.0);
            let _ = writeln!(
                track,
                "<trkpt lat=\"{:.8}\" lon=\"{:.8}\"><time>2026-01-01T{hour:02}:{minute:02}:{:09.6}Z</time></trkpt>",
                reading.latitude,
                reading.longitude,
                s % 60.0
            );
        }
    }
    track += "</trkseg></trk></gpx>\n";
    for (name, ahead_s) in [("ahead", 0.24), ("behind", -0.31)] {
        // A gyroscope needs a shorter drive than a track.
        folder(at, name, &readings[..400], ahead_s);
        fs::write(at.join(name).join("speed.csv"), &table).unwrap();
        let printed = ok(at, &format!("data inspect {name} --clock-offset auto"));
        is_within(&printed.stderr, 1e3 * ahead_s);
    }
    folder(at, "track", &readings, 0.24);
    fs::write(at.join("track/track.gpx"), &track).unwrap();
    let printed = ok(at, "data inspect track --clock-offset auto");
    is_within(&printed.stderr, 240.0);
    // A log that is imported: the measured offset is written to its dataset.toml, and none remains.
    fs::copy(at.join("track/track.gpx"), at.join("track.gpx")).unwrap();
    let printed = ok(
        at,
        "data import track.gpx --images images --intrinsics 139.43,277.07,117.13,65.82 --clock-offset -250 --out given",
    );
    assert!(
        !printed.stderr.contains("the camera's clock is"),
        "{}",
        printed.stderr
    );
    let config = fs::read_to_string(at.join("given/dataset.toml")).unwrap();
    assert!(
        config.contains("[clock]\ncamera_ahead_s = -0.25\n"),
        "{config}"
    );
    assert!(at.join("given/course.csv").exists());
    let speeds = fs::read_to_string(at.join("given/speed.csv")).unwrap();
    assert!(speeds.starts_with("time_s,speed_mps,speed_sigma_mps\n"));
    fs::create_dir(at.join("measured")).unwrap();
    fs::copy(at.join("track/frames.csv"), at.join("measured/frames.csv")).unwrap();
    let import = "data import track.gpx --images images --intrinsics 139.43,277.07,117.13,65.82 --clock-offset auto --out measured";
    let printed = ok(at, import);
    is_within(&printed.stderr, 240.0);
    let config = fs::read_to_string(at.join("measured/dataset.toml")).unwrap();
    let written = config.split("camera_ahead_s = ").nth(1).unwrap().trim();
    assert!(
        (written.parse::<f64>().unwrap() - 0.24).abs() < 0.05,
        "{config}"
    );
    fails(at, import, &["speed.csv: already exists"]);
    // Recordings with different offsets do not share a clock.
    fails(
        at,
        "data export-gt ahead behind --out gt.npz --clock-offset auto",
        &["those of the other drives", "one by one"],
    );
    // A recording whose offset cannot be measured gets that of the others, unless it states another.
    folder(at, "straight", &readings[..80], 0.24);
    let straight = readings[..80].iter().fold(
        String::from("time_s,speed_mps,yaw_rate_radps\n"),
        |text, reading| text + &format!("{:.6},8.0,0.0\n", reading.time_s),
    );
    fs::write(at.join("straight/speed.csv"), straight).unwrap();
    let both = "data export-gt ahead straight --out gt.npz --clock-offset auto";
    // The requested frame does not exist, but the clocks were measured first.
    let printed = run(at, both);
    assert!(
        printed
            .stderr
            .contains("using the offset of the other recordings"),
        "{}",
        printed.stderr
    );
    let mut config = fs::read_to_string(at.join("straight/dataset.toml")).unwrap();
    config += "[clock]\ncamera_ahead_s = 0.7\n";
    fs::write(at.join("straight/dataset.toml"), config).unwrap();
    fails(at, both, &["straight: its file gives", "+0.700 s"]);
}

#[test]
fn an_offset_that_cannot_be_found_is_refused() {
    let temporary = tempfile::tempdir().unwrap();
    let at = temporary.path();
    let readings = drive(at, 80);
    // Neither turns nor changes of speed.
    folder(at, "straight", &readings, 0.2);
    let mut table = String::from("time_s,speed_mps,yaw_rate_radps\n");
    for reading in &readings {
        let _ = writeln!(table, "{:.6},8.0,0.0", reading.time_s);
    }
    fs::write(at.join("straight/speed.csv"), table).unwrap();
    fails(
        at,
        "data inspect straight --clock-offset auto",
        &["the motion does not change", "--clock-offset MS"],
    );
    // A log whose clock offset cannot be measured is not imported.
    fs::create_dir(at.join("drive")).unwrap();
    fs::copy(at.join("straight/frames.csv"), at.join("drive/frames.csv")).unwrap();
    fails(
        at,
        "data import straight/speed.csv --images images --hfov 80 --clock-offset auto --out drive",
        &["the motion does not change", "--clock-offset MS"],
    );
    // Nor into the current folder.
    fails(
        &at.join("drive"),
        "data import ../straight/speed.csv --images ../images --hfov 80 --clock-offset auto --out .",
        &["the motion does not change", "--clock-offset MS"],
    );
    let left: Vec<_> = fs::read_dir(at.join("drive")).unwrap().collect();
    assert_eq!(left.len(), 1, "{left:?}");
    // Turns of another drive.
    folder(at, "other", &readings, 0.2);
    let mut table = String::from("time_s,speed_mps,yaw_rate_radps\n");
    for (i, reading) in readings.iter().enumerate() {
        let turn = 0.2 * (0.7 * i as f64).sin();
        let _ = writeln!(table, "{:.6},8.0,{turn:.4}", reading.time_s);
    }
    fs::write(at.join("other/speed.csv"), table).unwrap();
    fails(
        at,
        "data inspect other --clock auto",
        &["--clock-offset MS"],
    );
}
