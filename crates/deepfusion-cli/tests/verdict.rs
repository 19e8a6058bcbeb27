//! The verdict of `eval` without ground truth, compared with the simulator's truth.

use std::fs;
use std::path::Path;

use crate::support::{self, json, ok};
use serde_json::Value;

/// A drive of some 70 metres along a street that no network has seen.
const DRIVE: &str = "simulate --frames 80 --seed 90100 --moving-cars 2";

fn number(value: &Value) -> f64 {
    value
        .as_f64()
        .unwrap_or_else(|| panic!("not a number: {value}"))
}

/// The files below a folder whose names end with `end`.
fn files(folder: &Path, end: &str) -> Vec<std::path::PathBuf> {
    let mut found = Vec::new();
    for entry in fs::read_dir(folder).unwrap() {
        let path = entry.unwrap().path();
        if path.is_dir() {
            found.extend(files(&path, end));
        } else if path.to_string_lossy().ends_with(end) {
            found.push(path);
        }
    }
    found
}

#[test]
fn the_certificate_contains_the_true_scale() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    ok(at, &format!("{DRIVE} --scan-every 10 --out street"));
    let found = json(
        at,
        "eval --data street --assume-unseen --report page.html --json",
    );
    let certificate = &found["scale_certificate"];
    let (true_scale, scale) = (
        number(&found["scale"]["median"]),
        number(&certificate["scale"]),
    );
    let [low, high] = [0, 1].map(|i| number(&certificate["scale_ci95"][i]));
    assert!(low < true_scale && true_scale < high, "{certificate}");
    assert!((scale / true_scale).ln().abs() < 0.07, "{certificate}");
    assert!(number(&certificate["blocks"]) >= 5.0);
    // The given error of the speed widens the interval accordingly.
    let bias = |name: &str| [0, 1].map(|i| number(&certificate[name][i]));
    let wide = |[low, high]: [f64; 2]| high - low;
    assert!(wide(bias("ci95")) > wide(bias("ci95_given_speed")) + 0.02);
    let without = &found["without_truth"];
    assert_eq!(without["held_out"], true);
    let reprojection = &without["reprojection"];
    assert!(number(&reprojection["warped"]) < 0.7 * number(&reprojection["unwarped"]));
    assert!(number(&without["flip"]) < 0.1 && number(&without["consistency"]) < 0.1);
    let page = fs::read_to_string(at.join("page.html")).unwrap();
    assert!(page.contains("Without ground truth") && page.contains("95 % interval"));

    // A recorded speed 20 % too high: everything seems to be that much farther away.
    for path in files(&at.join("street"), ".txt") {
        if path.parent().unwrap().ends_with("oxts/data") {
            let text = fs::read_to_string(&path).unwrap();
            let mut values: Vec<f64> = text
                .split_whitespace()
                .map(|v| v.parse().unwrap())
                .collect();
            values[6..11].iter_mut().for_each(|v| *v *= 1.2);
            let words: Vec<String> = values.iter().map(f64::to_string).collect();
            fs::write(&path, words.join(" ")).unwrap();
        }
    }
    let fast = json(
        at,
        "eval --data street --assume-unseen --speed-error 0 --json",
    );
    let fast = &fast["scale_certificate"];
    let ratio = number(&fast["scale"]) / scale;
    assert!((1.15..1.25).contains(&ratio), "{ratio}: {fast}");
    assert_eq!(fast["ci95"], fast["ci95_given_speed"]);
}

#[test]
fn a_drive_without_ground_truth_has_a_verdict() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    ok(at, &format!("{DRIVE} --scan-every 0 --out drive"));
    let found = json(
        at,
        "eval --model tiny --data drive --assume-unseen --report page.html --json",
    );
    assert_eq!(found["certificate"], found["scale_certificate"]);
    assert!(found["certificate"]["ci95"].is_array(), "{found}");
    assert!(at.join("page.html").exists());
    let road = |found: &Value| -> Vec<(f64, f64)> {
        let rows = found["without_truth"]["road_speeds"].as_array().unwrap();
        rows.iter()
            .map(|row| (number(&row["from_mps"]), number(&row["ratio"])))
            .collect()
    };
    // At constant speed, there is nothing to compare the road's motion with.
    assert!(road(&found).is_empty(), "{found}");
    // An embedded network comes without a PoseNet.
    assert_eq!(
        found["without_truth"]["pose_speeds"],
        Value::Array(Vec::new())
    );
    // A signal twice too fast in the second half, where the speeds differ from the first.
    for path in files(&at.join("drive"), ".txt") {
        let frame = path.file_stem().unwrap().to_string_lossy().parse::<usize>();
        if path.parent().unwrap().ends_with("oxts/data") && frame.is_ok_and(|frame| frame >= 40) {
            let text = fs::read_to_string(&path).unwrap();
            let mut values: Vec<f64> = text
                .split_whitespace()
                .map(|v| v.parse().unwrap())
                .collect();
            values[6..11].iter_mut().for_each(|v| *v *= 2.0);
            let words: Vec<String> = values.iter().map(f64::to_string).collect();
            fs::write(&path, words.join(" ")).unwrap();
        }
    }
    let uneven = road(&json(
        at,
        "eval --model tiny --data drive --assume-unseen --json",
    ));
    let at_speed = |from: f64| uneven.iter().find(|(mps, _)| *mps == from).unwrap().1;
    let ratio = at_speed(8.0) / at_speed(15.0);
    assert!((1.7..2.3).contains(&ratio), "{uneven:?}");
    // A few metres of road give a value, but no interval.
    ok(
        at,
        "simulate --frames 20 --seed 90102 --scan-every 0 --out short",
    );
    let text = ok(at, "eval --model tiny --data short --assume-unseen").stdout;
    for part in [
        "scale  ",
        "too little road",
        "reprojection",
        "mirrored",
        "from depth",
    ] {
        assert!(text.contains(part), "{part}: {text}");
    }
    // Whether a packed network was trained on a simulated drive is not known.
    let unknown = json(at, "eval --model tiny --data short --json");
    assert_eq!(unknown["scale_certificate"], Value::Null);
    assert_eq!(unknown["no_certificate"], "seen_not_known");
    assert_eq!(unknown["without_truth"]["held_out"], Value::Null);
    assert!(unknown.get("unscaled").is_none());
    assert_eq!(unknown.get("certificate"), Some(&Value::Null));
    // Then there is no result at all.
    let none = support::run(at, "eval --model tiny --data short --no-verdict");
    assert_eq!(none.code, 1, "{}", none.stdout);
}

#[test]
fn frames_seen_in_training_give_no_certificate() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    ok(
        at,
        "simulate --frames 40 --seed 90101 --size 320x96 --scan-every 0 --out drive",
    );
    let train = "train --size 96x64 --batch 2 --steps 2 --init none";
    ok(
        at,
        &format!("{train} --data drive --set validation_share=0.4 --out run"),
    );
    let found = json(at, "eval --model run --data drive --json");
    let looked = number(&found["without_truth"]["frames"]);
    // After two steps PoseNet's speeds are arbitrary, but they are reported.
    let pose = found["without_truth"]["pose_speeds"].as_array().unwrap();
    assert!(
        !pose.is_empty() && number(&pose[0]["ratio"]) > 0.0,
        "{found}"
    );
    let all = json(at, "eval --model run --data drive --assume-unseen --json");
    let all = number(&all["without_truth"]["frames"]);
    assert!(looked > 0.0 && looked < all, "{looked} of {all}");
    ok(
        at,
        &format!("{train} --data drive --set validation_share=0 --out whole"),
    );
    let seen = json(at, "eval --model whole --data drive --json");
    assert_eq!(seen["no_certificate"], "all_seen");
    assert_eq!(seen["without_truth"]["held_out"], false);
}
