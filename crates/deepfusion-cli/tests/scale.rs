//! The scale monitor, through the program.

use std::fs;
use std::path::Path;

use crate::support::{fails, ok};
use image::imageops::{FilterType, crop_imm, resize};
use serde_json::Value;

const DRIVE: &str = "sim/2026_01_01/2026_01_01_drive_0081_sync";
/// Frames of the drive, and the first whose image is zoomed by 10 %.
const FRAMES: [usize; 2] = [250, 110];

fn number(folder: &Path, frame: usize, key: &str) -> Option<f64> {
    sidecar(folder, frame)["scale_monitor"][key].as_f64()
}

fn sidecar(folder: &Path, frame: usize) -> Value {
    let text = fs::read_to_string(folder.join(format!("{frame:010}.json"))).unwrap();
    serde_json::from_str(&text).unwrap()
}

#[test]
fn a_zoom_is_detected_and_depth_corrected() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    let [frames, zoomed_from] = FRAMES;
    ok(
        at,
        &format!(
            "simulate --out sim --frames {frames} --seed 81 --moving-cars 4 --size 320x96 --scan-every 0"
        ),
    );
    ok(
        at,
        "train --data sim --preset tiny --size 96x64 --batch 1 --steps 1 --init none --out run",
    );
    for frame in zoomed_from..frames {
        let path = at.join(format!("{DRIVE}/image_02/data/{frame:010}.png"));
        let image = image::open(&path).unwrap().into_rgb8();
        // About the principal point, which is the middle.
        let part = crop_imm(&image, 15, 4, 291, 87).to_image();
        resize(&part, 320, 96, FilterType::Triangle)
            .save(&path)
            .unwrap();
    }
    ok(
        at,
        &format!("predict --model run {DRIVE} --save depth-png --out plain"),
    );
    let printed = ok(
        at,
        &format!("predict --model run {DRIVE} --save depth-png --correct-scale --out corrected"),
    );
    assert_eq!(
        printed.stderr.matches("the scale has drifted").count(),
        1,
        "{}",
        printed.stderr
    );
    let (plain, corrected) = (at.join("plain"), at.join("corrected"));
    // The first frame has no predecessor; the next ones define the initial scale.
    assert!(sidecar(&plain, 0)["scale_monitor"].is_null());
    assert_eq!(
        sidecar(&plain, zoomed_from - 20)["scale_monitor"]["state"],
        "learning"
    );
    assert_eq!(
        sidecar(&plain, frames - 1)["scale_monitor"]["state"],
        "drift"
    );
    assert_eq!(number(&plain, frames - 1, "correction"), None);
    let ratio = number(&plain, frames - 1, "ratio").unwrap();
    let factor = number(&corrected, frames - 2, "correction").unwrap();
    assert!((factor / ratio - 1.0).abs() < 0.03, "{factor} {ratio}");
    assert!((1.05..1.16).contains(&factor), "{factor}");
    assert_eq!(number(&corrected, zoomed_from, "correction"), Some(1.0));
    // The written depth is corrected by the factor known before the frame.
    let depth = |folder: &Path, frame| sidecar(folder, frame)["depth_m"][0].as_f64().unwrap();
    let last = frames - 1;
    let change = depth(&corrected, last) / depth(&plain, last);
    assert!((change / factor - 1.0).abs() < 1e-4, "{change} {factor}");
    let before = zoomed_from - 1;
    assert_eq!(depth(&corrected, before), depth(&plain, before));
    // With other options, outputs of the other run are not reused.
    fails(
        at,
        &format!("predict --model run {DRIVE} --save depth-png --out corrected"),
        &["another --correct-scale"],
    );
    // Inputs that cannot be monitored are an error, not silently uncorrected.
    let images = format!("{DRIVE}/image_02/data");
    fails(
        at,
        &format!("predict --model run {images} --camera-height 1.6 --out none"),
        &["a single image has no motion", "--camera-height", "hint:"],
    );
    fails(
        at,
        "perceive --model run tcp://127.0.0.1:9 --correct-scale --out none",
        &["a live source has no measured motion", "--correct-scale"],
    );
    fails(
        at,
        &format!("predict --model run {DRIVE} --shard 1/2 --correct-scale --out none"),
        &["a shard has only some"],
    );
    assert!(!at.join("none").exists());
}
