//! `adapt`: results that are kept, refused, continued and undone.

#![cfg(feature = "train")]

use std::fs;
use std::path::{Path, PathBuf};

use crate::support::{fails, json, ok, run};
use serde_json::Value;

/// Some 60 metres along a street that no network has seen, and a network that trains quickly.
const DRIVE: &str = "simulate --frames 60 --seed 90110 --size 320x96 --scan-every 0 --out drive";
const ADAPT: &str =
    "adapt --model tiny --data drive --steps 4 --batch 1 --held-out 0.4 --set validate_every=4";

fn depth_of(at: &Path, model: &str, out: &str) -> Vec<u8> {
    ok(
        at,
        &format!("predict drive --shard 1/20 --model {model} --save npy --out {out}"),
    );
    let of = |path: &Path| fs::read(path).unwrap();
    let mut arrays = files(&at.join(out), "npy");
    arrays.sort();
    assert!(!arrays.is_empty());
    arrays.iter().flat_map(|path| of(path)).collect()
}

/// The camera's height above the road as an adaptation measured it, from its configuration.
fn seen_height(at: &Path, run: &str) -> f64 {
    let text = fs::read_to_string(at.join(run).join("config.toml")).unwrap();
    let line = text
        .lines()
        .find(|line| line.starts_with("height_m"))
        .unwrap();
    line.split('=').nth(1).unwrap().trim().parse().unwrap()
}

/// The files below a folder with an extension.
fn files(folder: &Path, extension: &str) -> Vec<PathBuf> {
    let mut found = Vec::new();
    for entry in fs::read_dir(folder).unwrap() {
        let path = entry.unwrap().path();
        if path.is_dir() {
            found.extend(files(&path, extension));
        } else if path.extension().is_some_and(|e| e == extension) {
            found.push(path);
        }
    }
    found
}

#[test]
fn a_network_that_gets_no_worse_is_kept_and_can_be_undone() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    ok(at, DRIVE);
    // Steps too small to change anything: the network stays as good as before.
    let found = json(
        at,
        &format!("{ADAPT} --simulated 1 --learning-rate 1e-9 --out mine --json"),
    );
    assert_eq!(found["kept"], true, "{found}");
    assert_eq!(found["worse"], Value::Array(Vec::new()));
    let reprojection = |when: &str| {
        let warped = &found[when]["without_truth"]["reprojection"]["warped"];
        warped.as_f64().unwrap()
    };
    let (before, after) = (reprojection("before"), reprojection("after"));
    assert!((after / before - 1.0).abs() < 1e-3, "{before}, {after}");
    assert!(at.join("mine/adapt.json").exists() && !at.join("mine.adapting").exists());

    // Streets were simulated for the drive's camera, which is 1.65 m above the road.
    let height = seen_height(at, "mine");
    assert!((height - 1.65).abs() < 0.15, "{height}");

    // The vehicle's motion warps the views, so no PoseNet is needed and there is none.
    let odometry = "eval-odometry --model mine --data drive";
    fails(at, odometry, &["mine", "has no PoseNet", "`freeze`"]);

    // The run is like any other: its data sets need not be named.
    let given = depth_of(at, "tiny", "given");
    let learned = depth_of(at, "mine", "learned");
    assert_ne!(learned, given, "something was learned");
    ok(at, "adapt --undo mine");
    assert_eq!(depth_of(at, "mine", "undone"), given);
    assert!(at.join("mine/adapted-last.safetensors").exists());
    fails(at, "adapt --undo mine", &["mine", "already undone"]);
}

#[test]
fn a_network_that_gets_worse_is_refused() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    ok(at, DRIVE);
    // Steps large enough to ruin any network.
    let command = format!(
        "{ADAPT} --simulated 0 --learning-rate 0.03 --set learning_rate_warmup_steps=0 --out mine"
    );
    for refused in ["mine.refused", "mine.refused-2"] {
        let found = run(at, &command);
        assert_eq!(found.code, 1, "{}", found.stderr);
        for part in ["not kept", refused, "hint: "] {
            assert!(found.stderr.contains(part), "{part}: {}", found.stderr);
        }
        assert!(found.stdout.contains("before") && !found.stdout.contains("kept"));
        let report = fs::read_to_string(at.join(refused).join("adapt.json")).unwrap();
        let report: Value = serde_json::from_str(&report).unwrap();
        assert_eq!(report["kept"], false);
        assert!(!report["worse"].as_array().unwrap().is_empty(), "{report}");
        assert!(!at.join("mine").exists());
    }
}

#[test]
fn an_interrupted_adaptation_is_continued() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    ok(at, &format!("{DRIVE} --stereo 0.5"));
    let command =
        format!("{ADAPT} --camera both --simulated 0 --learning-rate 1e-9 --out mine --json");
    let whole = json(at, &command);
    // Each of two cameras is a view of the other, without being asked for.
    let config = fs::read_to_string(at.join("mine/config.toml")).unwrap();
    assert!(config.contains("stereo = true"), "{config}");
    // As it was before the last evaluation.
    fs::rename(at.join("mine"), at.join("mine.adapting")).unwrap();
    fs::remove_file(at.join("mine.adapting/adapt.json")).unwrap();
    fails(
        at,
        &command.replace("--steps 4", "--steps 5"),
        &["mine.adapting", "other settings"],
    );
    let again = json(at, &command);
    assert_eq!(again, whole);
    fails(at, &command, &["mine", "already exists"]);
    // Nothing is started if the result could not be judged.
    ok(
        at,
        "simulate --frames 4 --seed 3 --scan-every 0 --out short",
    );
    let short = ADAPT.replace("drive", "short");
    fails(at, &format!("{short} --out other"), &["held-out"]);
    assert!(!at.join("other").exists() && !at.join("other.adapting").exists());
}
