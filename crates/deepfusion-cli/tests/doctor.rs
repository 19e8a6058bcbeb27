//! The output of `doctor`: a line for each check, whatever its result.

use std::fs;

use crate::support::{fails, json, ok, run};

const CHECKS: [&str; 18] = [
    "opening",
    "timing",
    "duplicates",
    "intrinsics",
    "standing",
    "speed",
    "lidar-speed",
    "dynamic-points",
    "steering",
    "clock",
    "turn",
    "heading",
    "ground",
    "parallax",
    "exposure",
    "blur",
    "bonnet",
    "stereo",
];

/// The lines of the checks, by name.
fn lines(text: &str) -> Vec<(&str, &str)> {
    let lines = text.lines().filter_map(|l| l.strip_prefix("  "));
    let named = lines.filter_map(|l| Some((l.split_whitespace().next()?, l)));
    let mut found: Vec<(&str, &str)> = named.filter(|(n, _)| CHECKS.contains(n)).collect();
    found.dedup();
    found
}

#[test]
fn every_check_has_a_line_with_its_result() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    ok(
        at,
        "simulate --out sim --frames 12 --seed 3 --scan-every 0 --size 160x96",
    );
    let text = run(at, "doctor sim").stdout;
    let printed = lines(&text);
    let names: Vec<&str> = printed.iter().map(|(name, _)| *name).collect();
    assert_eq!(names, CHECKS, "{text}");
    let line = |name: &str| printed.iter().find(|(n, _)| *n == name).unwrap().1;
    assert!(line("timing").ends_with(" ok"), "{text}");
    // Without a LiDAR its check is not ok, but skipped.
    assert!(
        line("lidar-speed").contains("not checked: no LiDAR"),
        "{text}"
    );
    assert!(
        line("stereo").contains("not checked: the recording has one camera"),
        "{text}"
    );

    let report = run(at, "doctor sim --json --report page.html").stdout;
    let report: serde_json::Value = serde_json::from_str(&report).unwrap();
    let checks = report["checks"].as_array().unwrap();
    assert_eq!(checks.len(), CHECKS.len());
    for check in checks {
        let why = &check["why"];
        match check["status"].as_str().unwrap() {
            "not_checked" => assert!(why.is_string(), "{check}"),
            "found" => assert!(check["findings"].as_u64().unwrap() > 0, "{check}"),
            status => assert_eq!(status, "ok", "{check}"),
        }
    }
    let page = fs::read_to_string(at.join("page.html")).unwrap();
    assert!(page.contains("not checked: no LiDAR"));
    // A recording that cannot be opened cannot be checked.
    fs::create_dir(at.join("empty")).unwrap();
    let text = run(at, "doctor empty").stdout;
    let names: Vec<&str> = lines(&text).iter().map(|(name, _)| *name).collect();
    assert_eq!(names, ["opening"], "{text}");
    let others = "all others      not checked: the recording cannot be opened";
    assert_eq!(text.matches(others).count(), 1, "{text}");
    let report = run(at, "doctor empty --json").stdout;
    let report: serde_json::Value = serde_json::from_str(&report).unwrap();
    assert_eq!(report["checks"].as_array().unwrap().len(), CHECKS.len());
}

/// The processor compared with itself: every operation is listed, and equal to the last bit.
#[cfg(feature = "train")]
#[test]
fn a_device_is_compared_with_the_processor() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    let found = json(at, "doctor --device cpu --json");
    assert_eq!(
        (&found["predict"], &found["train"]),
        (&true.into(), &true.into())
    );
    let operations = found["operations"].as_array().unwrap();
    assert!(operations.len() > 20);
    for operation in operations {
        assert_eq!(operation["right"], true, "{operation}");
        assert_eq!(operation["forward"], 0.0, "{operation}");
    }
    // The answer of the process that checks a GPU: a line for each operation from the given one on.
    let answers = ok(at, "doctor --device cpu --operations-from optimiser");
    let answers: Vec<serde_json::Value> = answers
        .stdout
        .lines()
        .map(|line| serde_json::from_str(line).unwrap())
        .collect();
    assert_eq!(answers.len(), 3, "the optimiser, and steps of two kinds");
    for answer in answers {
        assert_eq!(answer["forward"], 0.0, "{answer}");
        assert!(answer["failure"].is_null(), "{answer}");
    }
    // This build has no GPU backend: `auto` is the processor, and naming a GPU gives the hint how to build with one.
    ok(at, "doctor --device auto --operations-from optimiser");
    fails(
        at,
        "doctor --device metal:1",
        &["no `metal` backend", "--features metal"],
    );
    let unknown = run(at, "doctor --device gpu");
    assert_eq!(unknown.code, 2, "{}", unknown.stderr);
    assert!(unknown.stderr.contains("cpu, auto"), "{}", unknown.stderr);
}

/// A folder is judged by its good drives: a drive that stands still and one of a single frame are left out and named.
#[test]
fn a_drive_that_cannot_train_does_not_fail_its_folder() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    for (out, seed) in [("good", 3), ("single", 4), ("standing", 5)] {
        ok(
            at,
            &format!("simulate --out {out} --frames 12 --seed {seed} --scan-every 4 --size 160x96"),
        );
    }
    let all = at.join("all/2026_01_01");
    fs::create_dir_all(&all).unwrap();
    for (from, seed) in [("good", 3), ("single", 4), ("standing", 5)] {
        let date = at.join(from).join("2026_01_01");
        let name = format!("2026_01_01_drive_{seed:04}_sync");
        fs::rename(date.join(&name), all.join(&name)).unwrap();
        for file in fs::read_dir(&date).unwrap() {
            let file = file.unwrap();
            if file.path().is_file() {
                fs::copy(file.path(), all.join(file.file_name())).unwrap();
            }
        }
    }
    let (single, standing) = ("2026_01_01_drive_0004_sync", "2026_01_01_drive_0005_sync");
    for file in fs::read_dir(all.join(single).join("image_02/data")).unwrap() {
        let file = file.unwrap().path();
        if !file.ends_with("0000000000.png") {
            fs::remove_file(file).unwrap();
        }
    }
    for file in fs::read_dir(all.join(standing).join("oxts/data")).unwrap() {
        let file = file.unwrap().path();
        let text = fs::read_to_string(&file).unwrap();
        let words = text.split_whitespace().enumerate();
        let still = words.map(|(i, w)| if (8..11).contains(&i) { "0.0" } else { w });
        fs::write(&file, still.collect::<Vec<_>>().join(" ")).unwrap();
    }

    let report: serde_json::Value =
        serde_json::from_str(&run(at, "doctor all --json").stdout).unwrap();
    let findings = report["findings"].as_array().unwrap();
    for drive in [single, standing] {
        let left_out = findings.iter().find(|f| {
            let what = f["finding"]["what"].as_str().unwrap();
            f["drive"] == drive && what.contains("training leaves this drive out")
        });
        let left_out = left_out.unwrap_or_else(|| panic!("{drive}: {report:#}"));
        assert_eq!(left_out["finding"]["severity"], "warning");
    }
    let opening = |f: &&serde_json::Value| {
        f["finding"]["check"] == "opening" && f["finding"]["severity"] == "error"
    };
    assert_eq!(findings.iter().filter(opening).count(), 0, "{report:#}");
    let text = run(at, "doctor all").stdout;
    assert!(
        text.contains("ok in 3 of 3") || text.contains("ok in 2 of 3"),
        "{text}"
    );

    let trained = ok(
        at,
        "train --data all --size 96x64 --batch 2 --steps 1 --init none --out run",
    );
    for drive in [single, standing] {
        let named = trained
            .stderr
            .lines()
            .filter(|l| l.contains("skipped") && l.contains(drive));
        assert_eq!(named.count(), 1, "{}", trained.stderr);
    }
    let measured = json(at, "eval --model run --data all --json");
    assert_eq!(measured["n"], 7, "three of two drives, and one");
    ok(at, "eval-odometry --model run --data all --json");
    // By itself, such a drive cannot be trained on.
    let alone = run(at, &format!("doctor all/2026_01_01/{single}"));
    assert_eq!(alone.code, 1);
    assert!(
        alone
            .stdout
            .contains("no pair of frames can be used for training"),
        "{}",
        alone.stdout
    );
    fails(
        at,
        &format!("train --data all/2026_01_01/{single}"),
        &[single],
    );
}

/// The intrinsics are those of images half the size: every command that uses them warns.
#[cfg(feature = "train")]
#[test]
fn every_command_warns_of_a_camera_of_another_size() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    ok(
        at,
        "simulate --out sim --frames 12 --seed 3 --scan-every 0 --size 160x96",
    );
    let train = "train --data sim --size 96x64 --batch 2 --steps 1 --init none --out";
    let right = ok(at, &format!("{train} right")).stderr;
    assert!(!right.contains("not usable for training"), "{right}");
    let calibration = at.join("sim/2026_01_01/calib_cam_to_cam.txt");
    let text = fs::read_to_string(&calibration).unwrap();
    let halved = text.lines().map(|line| {
        let Some(numbers) = line.strip_prefix("P_rect_02: ") else {
            return format!("{line}\n");
        };
        let numbers = numbers
            .split_whitespace()
            .map(|n| n.parse::<f64>().unwrap());
        // The last row has no pixels.
        let numbers = numbers
            .enumerate()
            .map(|(i, n)| if i < 8 { 0.5 * n } else { n });
        let numbers: Vec<String> = numbers.map(|n| n.to_string()).collect();
        format!("P_rect_02: {}\n", numbers.join(" "))
    });
    fs::write(&calibration, halved.collect::<String>()).unwrap();
    for (command, expected) in [
        (
            &*format!("{train} half"),
            ["not usable for training: cx", "hint: scale the matrix"],
        ),
        (
            "predict sim --model right --out depth",
            ["is far from the middle of 160x96", "another size"],
        ),
        (
            "data inspect sim",
            ["is far from the middle of 160x96", "another size"],
        ),
    ] {
        let printed = ok(at, command).stderr;
        let about = |line: &&str| expected.iter().all(|part| line.contains(part));
        assert_eq!(
            printed.lines().filter(about).count(),
            1,
            "{command}: {printed}"
        );
    }
}

/// The findings of `doctor` about a log by itself: checks, texts and hints.
fn of_log(at: &std::path::Path, arguments: &str) -> Vec<(String, String, String)> {
    let text = run(at, &format!("doctor {arguments} --json")).stdout;
    let report: serde_json::Value = serde_json::from_str(&text).unwrap();
    let word = |finding: &serde_json::Value, key: &str| {
        finding["finding"][key].as_str().unwrap().to_owned()
    };
    let findings = report["findings"].as_array().unwrap().iter();
    findings
        .map(|f| (word(f, "check"), word(f, "what"), word(f, "remedy")))
        .collect()
}

#[test]
fn a_log_by_itself_is_reported_with_what_to_do() {
    let at =
        std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("../deepfusion-logs/tests/reference");
    let can = "--dbc vehicle.dbc --speed WheelSpeeds.VehicleSpeed";
    let says = |arguments: &str, check: &str, what: &str, hint: &str| {
        let found = of_log(&at, arguments);
        let fits = |f: &&(String, String, String)| {
            f.0 == check && f.1.contains(what) && f.2.contains(hint)
        };
        assert!(
            found.iter().any(|f| fits(&f)),
            "{arguments}: {check}: {found:#?}"
        );
    };
    let import = "deepfusion data import";
    says("phone.gpx", "log", "GPX track with 13 speeds", import);
    says("phone.gpx", "log-sure", "are accurate to", "--dbc FILE");
    says(
        "phone.gpx",
        "log-turns",
        "from positions alone",
        "gyroscope",
    );
    says(
        "phone.gpx",
        "log-clock",
        "dates in UTC",
        "--clock-offset auto",
    );
    says("torque.csv", "log", "speed from column", import);
    says("torque.csv", "log-clock", "without a time zone", "--zone");
    says("phyphox.csv", "log-clock", "are not dates", "--start");
    says("sensor_logger", "log", "301 yaw rates", import);
    for trace in ["candump.log", "vector.asc", "vector.blf"] {
        says(
            &format!("{trace} {can}"),
            "log",
            "CAN trace with 121 speeds",
            import,
        );
        says(
            trace,
            "opening",
            "a CAN trace needs a DBC file that describes its frames",
            "--dbc FILE",
        );
    }
    says(
        "german.csv",
        "opening",
        "no column looks like",
        "--speed COLUMN",
    );
    // A camera's own log, in an incomplete video file.
    says(
        "gopro.mp4",
        "log",
        "GoPro video with 110 speeds",
        "gopro.mp4 --out DRIVE",
    );
    let printed = run(&at, &format!("doctor vector.blf {can}"));
    assert_eq!(printed.code, 0, "{}", printed.stderr);
    assert_eq!(run(&at, "doctor vector.blf").code, 1);
    // Only CAN traces need a DBC file, whether it exists or not.
    for command in [
        "doctor torque.csv --dbc missing.dbc",
        "doctor phone.gpx --dbc vehicle.dbc",
        "data import torque.csv --dbc missing.dbc --images . --out drive",
    ] {
        let printed = run(&at, command);
        assert_eq!(printed.code, 2, "{command}: {}", printed.stderr);
        let expected = "--dbc does not apply to it: it is not a CAN trace";
        assert!(printed.stderr.contains(expected), "{}", printed.stderr);
    }
    let missing = run(&at, "doctor vector.blf --dbc missing.dbc").stdout;
    assert!(missing.contains("missing.dbc"), "{missing}");
    // A log has no camera and no images.
    for option in ["--hfov 60", "--clock-offset auto", "--report page.html"] {
        let name = option.split(' ').next().unwrap();
        let printed = run(&at, &format!("doctor phone.gpx {option}"));
        assert_eq!(printed.code, 2);
        let expected = format!("{name} does not apply to a log of speeds by itself");
        assert!(printed.stderr.contains(&expected), "{}", printed.stderr);
    }
}

/// A folder of images with a frame and a speed every tenth of a second.
fn write_folder(drive: &std::path::Path, speeds_mps: &[f64]) {
    let images = drive.join("images");
    fs::create_dir_all(&images).unwrap();
    let (mut frames, mut speeds) = ("time_s,file\n".to_owned(), "time_s,speed_mps\n".to_owned());
    for (i, speed_mps) in speeds_mps.iter().enumerate() {
        let grey = |x: u32, y: u32| image::Rgb([(x * 7 + y * 13 + i as u32 * 5) as u8; 3]);
        let image = image::RgbImage::from_fn(96, 64, grey);
        image.save(images.join(format!("{i}.png"))).unwrap();
        let time_s = 0.1 * i as f64;
        frames += &format!("{time_s:.1},{i}.png\n");
        speeds += &format!("{time_s:.1},{speed_mps}\n");
    }
    fs::write(drive.join("frames.csv"), frames).unwrap();
    fs::write(drive.join("speed.csv"), speeds).unwrap();
    fs::write(drive.join("intrinsics.txt"), "80 80 48 32\n").unwrap();
}

#[test]
fn a_speed_that_no_road_vehicle_reaches_is_reported_with_its_time() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    let found = |speeds_mps: &[f64]| {
        write_folder(&at.join("drive"), speeds_mps);
        let text = run(at, "doctor drive --json").stdout;
        let report: serde_json::Value = serde_json::from_str(&text).unwrap();
        let findings = report["findings"].as_array().unwrap().iter();
        let of_speed = findings.map(|found| found["finding"].clone());
        let too_fast = |found: &serde_json::Value| {
            found["check"] == "speed" && found["figure"]["quantity"] == "fastest"
        };
        of_speed.filter(too_fast).collect::<Vec<_>>()
    };
    // A sports car on a motorway.
    assert!(found(&[69.0; 12]).is_empty());
    for mps in [-500.0, 500.0] {
        let mut speeds_mps = [12.0; 12];
        speeds_mps[5] = mps;
        let findings = found(&speeds_mps);
        let [finding] = &findings[..] else {
            panic!("{findings:#?}");
        };
        assert_eq!(finding["severity"], "warning");
        assert_eq!(finding["frame"], 5);
        let (what, hint) = (&finding["what"], &finding["remedy"]);
        let expected = format!(
            "at 0.50 s the speed is {mps:.0} m/s ({:.0} km/h)",
            3.6 * mps
        );
        assert!(what.as_str().unwrap().contains(&expected), "{what}");
        assert!(hint.as_str().unwrap().contains("speed_kmh"), "{hint}");
    }
}

#[test]
fn speeds_in_another_unit_are_an_error_of_the_log() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    let mut table = "time_s,speed\n".to_owned();
    for i in 0..20 {
        table += &format!("{i},{}\n", 80 + i);
    }
    fs::write(at.join("log.csv"), table).unwrap();
    let found = of_log(at, "log.csv --unit m/s");
    assert!(
        found
            .iter()
            .any(|f| f.0 == "log-speed" && f.2.contains("--unit km/h")),
        "{found:#?}"
    );
    let found = of_log(at, "log.csv --unit km/h");
    assert!(!found.iter().any(|f| f.0 == "log-speed"), "{found:#?}");
}
