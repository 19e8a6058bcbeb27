//! Ctrl-C in `simulate` and `data convert`: no incomplete output is left, and nothing blocks the next attempt.

#![cfg(unix)]

use std::fs;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::time::Duration;

use crate::support::ok;

/// Starts the program, sends SIGINT once it writes into `out`, and checks how it ends.
fn stop(folder: &Path, args: &str, out: &Path) {
    let mut child = Command::new(env!("CARGO_BIN_EXE_deepfusion"))
        .current_dir(folder)
        .args(args.split_whitespace())
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .unwrap();
    // The temporary output appears after the handler is set.
    while !is_writing(out) && child.try_wait().unwrap().is_none() {
        std::thread::sleep(Duration::from_millis(1));
    }
    let pid = child.id().to_string();
    let sent = Command::new("kill").args(["-INT", &pid]).status().unwrap();
    assert!(sent.success());
    let output = child.wait_with_output().unwrap();
    let text = String::from_utf8(output.stderr).unwrap();
    assert_eq!(output.status.code(), Some(130), "{args}: {text}");
    assert_eq!(output.stdout, b"", "{args}");
    for part in [
        "stopping after the current frames",
        "nothing is written: stopped after",
        "hint: start it again",
    ] {
        assert!(text.contains(part), "{args}: {text}");
    }
}

/// Whether a temporary folder for the output contains something.
fn is_writing(out: &Path) -> bool {
    fs::read_dir(out)
        .into_iter()
        .flatten()
        .flatten()
        .any(|entry| entry.path().extension().is_some_and(|e| e == "partial"))
}

fn entries(folder: &Path) -> Vec<PathBuf> {
    let entries = fs::read_dir(folder).unwrap();
    entries.map(|entry| entry.unwrap().path()).collect()
}

#[test]
fn a_simulation_that_is_stopped_leaves_nothing() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    for format in ["kitti", "bag"] {
        let simulate = format!("simulate --out new/{format} --format {format} --size 192x64");
        let long = format!("{simulate} --frames 600");
        stop(at, &long, &at.join("new").join(format));
        assert!(entries(at).is_empty(), "{format}: {:?}", entries(at));
        ok(at, &format!("{simulate} --frames 1"));
        fs::remove_dir_all(at.join("new")).unwrap();
    }
}

#[test]
fn a_conversion_that_is_stopped_leaves_nothing() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    ok(
        at,
        "simulate --out sim --frames 1 --size 320x96 --scan-every 0",
    );
    let picture = "sim/2026_01_01/2026_01_01_drive_0001_sync/image_02/data/0000000000.png";
    let images = at.join("drive/images");
    fs::create_dir_all(&images).unwrap();
    for i in 0..3000 {
        fs::hard_link(at.join(picture), images.join(format!("{i:06}.png"))).unwrap();
    }
    fs::write(
        at.join("drive/dataset.toml"),
        "fps = 10.0\nhfov_deg = 60.0\n",
    )
    .unwrap();
    let out = at.join("out");
    fs::create_dir(&out).unwrap();
    for target in ["out", "out/drive.bag"] {
        stop(at, &format!("data convert drive {target}"), &out);
        assert!(entries(&out).is_empty(), "{target}: {:?}", entries(&out));
    }
}
