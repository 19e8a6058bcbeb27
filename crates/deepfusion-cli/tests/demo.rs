//! The demo, shortened by options that its help does not show.

use std::fs;
use std::path::Path;

use crate::support::{fails, json, ok, run};

/// Whether this build embeds the network of the demo.
fn has_network() -> bool {
    deepfusion_weights::names().any(|name| name == deepfusion_weights::DEFAULT)
}

/// Asserts that the files of a demo exist and are not empty.
fn assert_files_exist(demo: &Path, files: &[&str]) {
    for file in files {
        let length = fs::metadata(demo.join(file)).map_or(0, |file| file.len());
        assert!(length > 0, "{file}");
    }
}

/// Zero-shot and after training: pictures, a cloud, targets and the report. Existing files are not replaced.
#[test]
fn the_demo_shows_the_embedded_network_and_what_learning_adds() {
    if !has_network() {
        return;
    }
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    let demo = "demo --out first --frames 12 --steps 1 --size 192x64";
    let run = ok(at, demo);
    assert_eq!(run.stdout.trim(), "first/report.html");
    for part in [
        "1/4",
        "2/4",
        "3/4",
        "4/4",
        "an image became metres",
        "done in",
    ] {
        assert!(run.stderr.contains(part), "{part}: {}", run.stderr);
    }
    // Trained on seven of twelve frames, evaluated on the last four.
    let split = |name: &str| fs::read_to_string(at.join("first").join(name)).unwrap();
    assert_eq!(split("learned.txt").lines().count(), 7);
    assert_eq!(split("measured.txt").lines().count(), 4);
    assert_files_exist(
        &at.join("first"),
        &[
            "pictures/0000000009_side.png",
            "pictures/0000000009_depth.png",
            "pictures/0000000009_truth.png",
            "pictures/0000000009_error.png",
            "pictures/0000000009_side_learned.png",
            "pictures/0000000009_error_learned.png",
            "cloud.ply",
            "targets/targets.jsonl",
            "targets/0000000009_overlay.png",
            "model/last.safetensors",
            "report.html",
        ],
    );
    let targets = split("targets/targets.jsonl");
    assert_eq!(targets.lines().count(), 12, "every frame has targets");
    let report = split("report.html");
    for word in ["Abs Rel zero-shot", "after learning", "mean-depth baseline"] {
        assert!(report.contains(word), "{word}");
    }
    fails(at, demo, &["first", "already exists", "another folder"]);
}

#[test]
fn the_demo_from_scratch_ends_in_a_report() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    let report = json(
        at,
        "demo --from-scratch --out anew --frames 12 --steps 2 --size 192x64 --json",
    );
    assert_eq!(report["n"], 2, "every eighth of twelve frames: {report}");
    assert_files_exist(
        &at.join("anew"),
        &[
            "pictures/0000000001_side.png",
            "pictures/0000000008_side.png",
            "pictures/0000000001_truth.png",
            "cloud.ply",
            "model/last.safetensors",
            "report.html",
        ],
    );
    // A drive that is too short to evaluate on.
    let few = run(at, "demo --out few --frames 11");
    assert_eq!(few.code, 2, "{}", few.stderr);
}

/// Ctrl-C while the drive is simulated: no half-written files remain, and the folder can be used again.
#[test]
#[cfg(unix)]
fn the_demo_can_be_stopped_while_it_simulates() {
    use std::io::{BufRead, BufReader, Read};
    use std::process::{Command, Stdio};

    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    let demo = "demo --from-scratch --out stopped --frames 600 --size 192x64";
    let mut child = Command::new(env!("CARGO_BIN_EXE_deepfusion"))
        .current_dir(at)
        .args(demo.split_whitespace())
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .unwrap();
    let mut stderr = BufReader::new(child.stderr.take().unwrap());
    let mut text = String::new();
    while !text.contains("1/4") {
        assert!(stderr.read_line(&mut text).unwrap() > 0, "{text}");
    }
    let pid = child.id().to_string();
    let sent = Command::new("kill").args(["-INT", &pid]).status().unwrap();
    assert!(sent.success());
    stderr.read_to_string(&mut text).unwrap();
    let output = child.wait_with_output().unwrap();
    assert_eq!(output.status.code(), Some(130), "{text}");
    assert_eq!(output.stdout, b"");
    for part in ["stopping after", "the demo was stopped", "another folder"] {
        assert!(text.contains(part), "{text}");
    }
    let left = fs::read_dir(at.join("stopped")).unwrap().count();
    assert_eq!(left, 0, "it stopped before the end of the drive");
}
