//! Splits: how much of one was used, and that no frame is both trained on and validated on.

use std::fs;
use std::path::Path;

use crate::support::{fails, json, ok, run};

const DRIVE: &str = "2026_01_01/2026_01_01_drive_0003_sync";
const SMALL: &str = "--size 96x64 --batch 2 --steps 1 --init none";

/// A split of these frames of the drive, and of as many frames of a drive that does not exist.
fn write_split(at: &Path, name: &str, numbers: impl Iterator<Item = u32>, elsewhere: u32) {
    let here = numbers.map(|n| format!("{DRIVE} {n} l\n"));
    let there = (0..elsewhere).map(|n| format!("2026_01_01/2026_01_01_drive_0009_sync {n} l\n"));
    let lines: String = here.chain(there).collect();
    fs::write(at.join(name), lines).unwrap();
}

#[test]
fn a_split_of_which_only_a_part_exists_gives_a_warning() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    ok(
        at,
        "simulate --out sim --frames 8 --seed 3 --scan-every 2 --size 160x96",
    );
    ok(at, &format!("train --data sim {SMALL} --out run"));
    // Frames 0 and 2 have scans, 3 has none.
    write_split(at, "part.txt", [0, 2, 3].into_iter(), 2);
    write_split(at, "bare.txt", [0, 2, 3].into_iter(), 0);
    write_split(at, "whole.txt", [0, 2].into_iter(), 0);
    let eval = "eval --model run --data sim --crop none";

    let printed = ok(at, &format!("{eval} --split part.txt"));
    assert!(
        printed.stdout.contains("\n2 of the split's 5 images, "),
        "{}",
        printed.stdout
    );
    let warned = |part: &str| {
        let found = printed.stderr.lines().filter(|l| l.contains(part)).count();
        assert_eq!(found, 1, "{part}: {}", printed.stderr);
    };
    warned(
        "part.txt: found 3 of 5 frames (60.0 %); the first missing one is 2026_01_01/2026_01_01_drive_0009_sync 0 l",
    );
    warned("part.txt: 2 of 5 frames have ground truth (40.0 %)");
    let report = json(at, &format!("{eval} --split part.txt --json"));
    assert_eq!((&report["n"], &report["expected"]), (&2.into(), &5.into()));
    fails(
        at,
        &format!("{eval} --split part.txt --strict"),
        &["part.txt", "only 3 of 5 frames"],
    );
    fails(
        at,
        &format!("{eval} --split bare.txt --strict"),
        &["bare.txt", "only 2 of 3 frames have ground truth"],
    );
    let whole = run(at, &format!("{eval} --split whole.txt --strict"));
    assert_eq!(whole.code, 0, "{}", whole.stderr);
    assert!(!whole.stderr.contains("whole.txt"), "{}", whole.stderr);
    // Without a split no frames are expected.
    let report = json(at, &format!("{eval} --json"));
    assert!(report["expected"].is_null());

    let export = "data export-gt sim";
    let printed = ok(at, &format!("{export} --split part.txt --out a.npz --json"));
    let written: serde_json::Value = serde_json::from_str(&printed.stdout).unwrap();
    assert_eq!(
        (&written["frames"], &written["expected"]),
        (&2.into(), &5.into())
    );
    assert!(
        printed.stderr.contains("found 3 of 5 frames"),
        "{}",
        printed.stderr
    );
    for split in ["part.txt", "bare.txt"] {
        fails(
            at,
            &format!("{export} --split {split} --strict --out b.npz"),
            &[split],
        );
        assert!(!at.join("b.npz").exists(), "no incomplete file is left");
    }
    ok(
        at,
        &format!("{export} --split whole.txt --strict --out b.npz"),
    );
}

#[test]
fn validation_frames_that_are_trained_on_are_refused() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    ok(
        at,
        "simulate --out sim --frames 12 --seed 3 --scan-every 0 --size 160x96",
    );
    let train = |rest: &str| format!("train --data sim {SMALL} {rest}");
    // Eleven pairs, the same in both.
    let shared = [
        "validation frames are also training frames",
        "11 of 2026_01_01_drive_0003_sync",
    ];
    fails(at, &train("--val-data sim --out a"), &shared);
    write_split(at, "train.txt", 0..7, 0);
    write_split(at, "val.txt", 8..12, 0);
    write_split(at, "across.txt", 4..12, 0);
    // The split selects training frames only; the whole of the same root, including them, would be validated on.
    fails(
        at,
        &train("--split train.txt --val-data sim --out a"),
        &["7 of 2026_01_01_drive_0003_sync"],
    );
    fails(
        at,
        &train("--split train.txt --val-split across.txt --out a"),
        &["3 of 2026_01_01_drive_0003_sync"],
    );
    assert!(!at.join("a").exists());
    // Separate frames, with or without --val-data.
    let own = ok(at, &train("--split train.txt --val-split val.txt --out b"));
    assert!(!own.stderr.contains("validation frames"), "{}", own.stderr);
    let config = fs::read_to_string(at.join("b/config.toml")).unwrap();
    let kept = format!("validation_split = {:?}", at.join("val.txt"));
    assert!(config.contains(&kept), "{config}");
    ok(
        at,
        &train("--split train.txt --val-data sim --val-split val.txt --out c"),
    );
    // Frames that training saw as neighbours give a warning.
    write_split(at, "next.txt", 7..12, 0);
    let next = ok(at, &train("--split train.txt --val-split next.txt --out d"));
    assert!(
        next.stderr
            .contains("drive_0003_sync: 1 validation frame is a neighbour"),
        "{}",
        next.stderr
    );
}
