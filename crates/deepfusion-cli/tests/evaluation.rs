//! A trained model's depth on dynamic objects and its pose network's trajectory, through the program.

use std::fs;

use crate::support::{fails, json, ok, run};
use deepfusion_eval::odometry::PoseFile;
use deepfusion_geometry::DepthRange;
use deepfusion_train::{DataConfig, DataSetConfig, RunFolder, TrainConfig};
use serde_json::Value;

#[test]
fn a_model_is_evaluated_on_traffic_and_along_the_road() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    ok(
        at,
        "simulate --out sim --frames 40 --seed 3 --scan-every 8 --moving-cars 6 --size 320x96",
    );
    ok(
        at,
        "train --data sim --size 96x64 --batch 2 --steps 2 --init none --out run",
    );

    let report = json(at, "eval --model run --data sim --crop none --json");
    assert_eq!(report["n"], 5);
    for part in ["static", "moving"] {
        assert!(report[part]["abs_rel"].is_f64(), "{part}: {report}");
        assert_eq!(report[part].as_object().unwrap().len(), 7);
    }
    assert!(report["hole_rate"].is_f64() && report["hole_rate_moving"].is_f64());
    let images = report["moving_images"].as_u64().unwrap();
    assert!((1..=5).contains(&images));
    let table = ok(at, "eval --model run --data sim --crop none").stdout;
    assert!(table.contains("\nstatic ") && table.contains("\nmoving, "));

    let odometry = "eval-odometry --model run --data sim";
    let printed = ok(at, &format!("{odometry} --out paths --json"));
    // The camera is the training camera: no warning.
    assert!(
        !printed.stderr.contains("focal length"),
        "{}",
        printed.stderr
    );
    let report: Value = serde_json::from_str(&printed.stdout).unwrap();
    assert_eq!(report["n"], 40);
    assert_eq!(report["truth"], "the simulator's exact poses");
    assert!(report["scale"].as_f64().unwrap() > 0.0);
    assert!(report["ate_m"].as_f64().unwrap() > 0.0);
    let distance = report["distance_m"].as_f64().unwrap();
    let lengths = report["lengths_m"].as_array().unwrap();
    assert_eq!(lengths.is_empty(), distance <= 10.0);
    assert_eq!(report["t_rel_percent"].is_f64(), distance > 10.0);

    // The written trajectory has the same scores as the computed one, in both formats.
    let name = "2026_01_01_drive_0003_sync";
    for kind in ["txt", "tum"] {
        let files = format!("--pred {name}_predicted.{kind} --gt {name}_truth.{kind}");
        let again = json(&at.join("paths"), &format!("eval-odometry {files} --json"));
        for field in ["ate_m", "scale", "distance_m", "rpe_deg"] {
            let (a, b) = (report[field].as_f64(), again[field].as_f64());
            let (a, b) = (a.unwrap(), b.unwrap());
            assert!((a - b).abs() < 1e-6 * a.abs(), "{field}: {a} and {b}");
        }
    }
    let svg = fs::read_to_string(at.join(format!("paths/{name}.svg"))).unwrap();
    assert_eq!(svg.matches("<polyline").count(), 2);
    let truth = PoseFile::read(&at.join(format!("paths/{name}_truth.tum"))).unwrap();
    assert_eq!(truth.poses.len(), truth.times_s.len());

    // Without the exact poses the truth is OXTS's path, which agrees to a few per mille.
    let poses = at.join(format!("sim/2026_01_01/{name}/poses.txt"));
    fs::rename(&poses, at.join("poses.txt")).unwrap();
    let oxts = json(at, &format!("{odometry} --out oxts --json"));
    assert_eq!(oxts["truth"], "OXTS attitude and integrated velocity");
    let files = format!("--pred oxts/{name}_truth.txt --gt paths/{name}_truth.txt");
    let off = json(at, &format!("eval-odometry {files} --json"));
    assert!(off["ate_m"].as_f64().unwrap() < 0.01, "{off}");
    assert!((off["scale"].as_f64().unwrap() - 1.0).abs() < 2e-3, "{off}");
}

/// Post-processing, points as a table, and depth images instead of scans.
#[test]
fn the_protocols_of_published_tables() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    ok(
        at,
        "simulate --out sim --frames 4 --seed 3 --scan-every 2 --size 320x96",
    );
    ok(
        at,
        "train --data sim --size 96x64 --batch 2 --steps 2 --init none --out run",
    );
    let eval = "eval --model run --data sim --crop none --no-verdict --json";
    let plain = json(at, eval);
    let blended = json(at, &format!("{eval} --post-process flip"));
    assert_eq!(blended["n"], plain["n"]);
    let abs_rel = |report: &Value| report["unscaled"]["abs_rel"].as_f64().unwrap();
    assert_ne!(abs_rel(&plain), abs_rel(&blended));
    let kept: Vec<String> = fs::read_dir(at.join("run/eval"))
        .unwrap()
        .map(|entry| fs::read_to_string(entry.unwrap().path()).unwrap())
        .collect();
    assert_eq!(kept.len(), 2, "each under a name of its own");
    let post_processed = kept
        .iter()
        .filter(|text| text.contains(r#""post_process": "flip""#));
    assert_eq!(post_processed.count(), 1);
    // It was trained with one camera at one size; an embedded network takes any.
    fails(
        at,
        &format!("{eval} --post-process multi-scale"),
        &["canonical focal length", "flip"],
    );
    let tiny = "eval --model tiny --data sim --crop none --no-verdict --json";
    let one = abs_rel(&json(at, tiny));
    for how in ["multi-scale", "multi-scale-flip"] {
        let many = abs_rel(&json(at, &format!("{tiny} --post-process {how}")));
        assert!(
            many != one && (many / one - 1.0).abs() < 0.3,
            "{how}: {many}, {one}"
        );
    }

    // Every second frame has a scan, every frame a depth image; the simulator's are exact, and camera z as well.
    let annotated = json(at, &format!("{eval} --gt-depth annotated"));
    assert_eq!((&plain["n"], &annotated["n"]), (&2.into(), &4.into()));
    assert_eq!(annotated["protocol"]["gt"], "annotated");
    let (scans, images) = (abs_rel(&plain), abs_rel(&annotated));
    assert!((scans / images - 1.0).abs() < 0.3, "{scans} and {images}");

    let drawn = json(at, &format!("{eval} --points 50 --points-out points.csv"));
    let table = fs::read_to_string(at.join("points.csv")).unwrap();
    let rows: Vec<Vec<&str>> = table
        .lines()
        .map(|line| line.split(',').collect())
        .collect();
    assert_eq!((rows.len(), rows[0].len()), (51, 16));
    let column = |name: &str| rows[0].iter().position(|head| *head == name).unwrap();
    let number = |row: &[&str], name: &str| row[column(name)].parse::<f64>().unwrap();
    let mean = |name: &str| rows[1..].iter().map(|row| number(row, name)).sum::<f64>() / 50.0;
    let close = |name: &str, reported: &Value| {
        let reported = reported.as_f64().unwrap();
        assert!(
            (mean(name) - reported).abs() < 1e-3,
            "{name}: {} and {reported}",
            mean(name)
        );
    };
    close("error_m", &drawn["points"]["mean_m"]);
    close(
        "scaled_error_m",
        &drawn["points"]["median_scaled"]["mean_m"],
    );
    for row in &rows[1..] {
        let along: f64 = ["x", "y", "z"]
            .map(|axis| {
                number(row, &format!("pred_{axis}_m")) - number(row, &format!("gt_{axis}_m"))
            })
            .map(|off| off * off)
            .iter()
            .sum();
        assert!(
            (along.sqrt() - number(row, "error_m")).abs() < 1e-3,
            "{row:?}"
        );
        assert!(number(row, "u") < 320.0 && number(row, "v") < 96.0);
    }
    let alone = run(at, "eval --model run --data sim --points-out points.csv");
    assert_eq!(alone.code, 2, "{}", alone.stderr);
}

#[test]
fn poses_that_cannot_be_compared_are_errors() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    let row = |z: f64| format!("1 0 0 0 0 1 0 0 0 0 1 {z}\n");
    let rows = |n: u32| -> String { (0..n).map(|i| row(f64::from(i))).collect() };
    fs::write(at.join("six.txt"), rows(6)).unwrap();
    fs::write(at.join("five.txt"), rows(5)).unwrap();
    fs::write(at.join("one.txt"), rows(1)).unwrap();
    fs::write(at.join("short.txt"), format!("{}1 2 3\n", rows(2))).unwrap();
    fs::write(at.join("nan.txt"), rows(3).replace("1 2\n", "1 nan\n")).unwrap();
    fs::write(at.join("skew.txt"), rows(2).replace("1 0 0", "3 0 0")).unwrap();
    let tum = "0.2 0 0 0 0 0 0 1\n0.1 0 0 1 0 0 0 1\n";
    fs::write(at.join("back.tum"), tum).unwrap();
    for (file, expected) in [
        ("five.txt", "5 predicted poses, 6 true poses"),
        ("short.txt", "short.txt:3: 3 columns"),
        ("nan.txt", "nan.txt:3: NaN is not a finite number"),
        (
            "skew.txt",
            "skew.txt:1: its first three columns are not a rotation",
        ),
        ("back.tum", "back.tum:2: time 0.1 is not after 0.2"),
        ("none.txt", "none.txt"),
    ] {
        fails(
            at,
            &format!("eval-odometry --pred {file} --gt six.txt"),
            &[expected],
        );
    }
    fails(
        at,
        "eval-odometry --pred one.txt --gt one.txt",
        &["expected at least 2"],
    );
    let same = json(at, "eval-odometry --pred six.txt --gt six.txt --json");
    assert_eq!(same["scale"], 1.0);
    assert_eq!(same["ate_m"], 0.0);
    assert!(same["t_rel_percent"].is_null());
    let table = ok(at, "eval-odometry --pred six.txt --gt six.txt").stdout;
    assert!(table.contains("no stretches of 10 m"), "{table}");
}

/// Two data sets in one run: each has its own scale, so the one to use must be named.
#[test]
fn several_data_sets_are_learned_together() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    ok(
        at,
        "simulate --out road --frames 12 --seed 3 --scan-every 4 --size 320x96",
    );
    ok(
        at,
        "simulate --out yard --frames 12 --seed 4 --scan-every 4 --size 240x96 --fps 30",
    );
    ok(
        at,
        "train --data road --size 96x64 --batch 2 --steps 1 --init none --out first",
    );
    let mut config = TrainConfig::read(&at.join("first/config.toml")).unwrap();
    config.pose_net.metres_per_unit = 0.0;
    let set = |name: &str, range| DataSetConfig {
        name: name.into(),
        paths: vec![name.into()],
        range,
        ..DataSetConfig::default()
    };
    let near = DepthRange {
        min_m: 0.2,
        max_m: 40.0,
    };
    config.data = DataConfig {
        sets: vec![set("road", None), set("yard", Some(near))],
        ..DataConfig::default()
    };
    fs::write(at.join("both.toml"), config.to_toml().unwrap()).unwrap();
    ok(at, "train --config both.toml --out both");
    let (both, _) = RunFolder::open(&at.join("both")).unwrap();
    let trained = both.read_config().unwrap();
    let [road, yard] = [0, 1].map(|i| &trained.data.sets[i]);
    assert!(road.metres_per_unit > 1.5 * yard.metres_per_unit && yard.metres_per_unit > 0.0);

    for command in [
        "eval --model both --data road",
        "eval-odometry --model both --data yard",
    ] {
        fails(at, command, &["one of road, yard"]);
        fails(at, &format!("{command} --data-set yrad"), &["found yrad"]);
    }
    fails(
        at,
        "train --data road --config both.toml --resume --out both",
        &["--data", "data.sets"],
    );
    let scale = |set: &str| {
        let report = json(
            at,
            &format!("eval --model both --data road --data-set {set} --json"),
        );
        report["unscaled"]["abs_rel"].as_f64().unwrap()
    };
    // Another depth range and another focal length give other metres.
    assert_ne!(scale("road"), scale("yard"));
    let ratio = |set: &str| {
        let args = format!("eval-odometry --model both --data road --set {set} --json");
        json(at, &args)["scale"].as_f64().unwrap()
    };
    let expected = road.metres_per_unit / yard.metres_per_unit;
    let found = ratio("yard") / ratio("road");
    assert!(
        (found / expected - 1.0).abs() < 0.01,
        "{found} and {expected}"
    );
    ok(at, "train --resume --out both --steps 2");
}
