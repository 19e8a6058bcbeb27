//! RGB-D folders through the program: the colour images are used, with the folder's own camera.

use std::path::Path;

use crate::support::{fails, json, ok};
use image::{ImageBuffer, Luma, Rgb, RgbImage};
use serde_json::Value;

/// Three frames as 7-Scenes has them, 96x64, and the camera they share.
pub(crate) fn write_folder(folder: &Path) {
    std::fs::create_dir_all(folder).unwrap();
    for n in 0..3_u32 {
        let at = |ending: &str| folder.join(format!("frame-{n:06}.{ending}"));
        let colour = |x: u32, y: u32| Rgb([(x * 2) as u8, (y * 3) as u8, (40 * n) as u8]);
        RgbImage::from_fn(96, 64, colour)
            .save(at("color.png"))
            .unwrap();
        let depth: ImageBuffer<Luma<u16>, _> = ImageBuffer::from_pixel(96, 64, Luma([1500]));
        depth.save(at("depth.png")).unwrap();
    }
    let camera = folder.join("camera-intrinsics.txt");
    std::fs::write(camera, "90 0 47.5\n0 91 31.5\n0 0 1\n").unwrap();
}

/// A network trained for one step.
fn train(folder: &Path) {
    ok(
        folder,
        "simulate --out sim --frames 8 --scan-every 0 --size 96x64",
    );
    ok(
        folder,
        "train --data sim --size 96x64 --batch 2 --steps 1 --init none --out run",
    );
}

#[test]
fn depth_images_are_not_taken_for_pictures() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    train(at);
    write_folder(&at.join("desk"));
    let printed = json(at, "predict --model run desk --out depth --json");
    let sidecars = printed.as_array().unwrap();
    assert_eq!(sidecars.len(), 3, "one per frame: {printed}");
    for (n, sidecar) in sidecars.iter().enumerate() {
        let image = sidecar["image"].as_str().unwrap();
        assert!(
            image.ends_with(&format!("frame-{n:06}.color.png")),
            "{image}"
        );
        assert_eq!(
            sidecar["intrinsics"],
            serde_json::json!([90.0, 91.0, 47.5, 31.5])
        );
        assert_eq!(sidecar["intrinsics_from"], "recording");
    }
    let lines = ok(at, "perceive --model run desk --out targets --json").stdout;
    let frames: Vec<Value> = lines
        .lines()
        .map(|line| serde_json::from_str(line).unwrap())
        .collect();
    assert_eq!(frames.len(), 3);
    // Without its camera, depth in metres cannot be predicted: an error, not a guess.
    std::fs::remove_file(at.join("desk/camera-intrinsics.txt")).unwrap();
    fails(
        at,
        "predict --model run desk --out other",
        &["desk", "camera-intrinsics.txt", "--intrinsics"],
    );
    ok(
        at,
        "predict --model run desk --intrinsics 90,91,47.5,31.5 --out other",
    );
    // Other folders of images are unaffected, whatever their file names end in.
    std::fs::create_dir(at.join("pictures")).unwrap();
    for name in ["a.color.png", "a.depth.png"] {
        let from = at.join("desk/frame-000000.color.png");
        std::fs::copy(from, at.join("pictures").join(name)).unwrap();
    }
    let printed = json(
        at,
        "predict --model run pictures --intrinsics 90,91,47.5,31.5 --out plain --json",
    );
    assert_eq!(printed.as_array().unwrap().len(), 2, "{printed}");
    // From the field of view: 96 pixels cover 90 degrees.
    let printed = json(
        at,
        "predict --model run pictures --hfov 90 --out wide --json",
    );
    let k: Vec<f64> = serde_json::from_value(printed[0]["intrinsics"].clone()).unwrap();
    assert!((k[0] - 48.0).abs() < 1e-9 && k[0] == k[1], "{printed}");
    assert_eq!(k[2..], [47.5, 31.5]);
    assert_eq!(printed[0]["intrinsics_from"], "given");
    assert_eq!(printed[0]["made_with"]["hfov_deg"], 90.0);
}

#[test]
fn a_conversion_reports_what_the_recording_lacks() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    write_folder(&at.join("desk"));
    let converted = ok(at, "data convert desk kitti");
    assert!(
        converted.stderr.contains("desk: no times and no speeds"),
        "{}",
        converted.stderr
    );
    std::fs::write(at.join("desk/dataset.toml"), "fps = 30.0\n").unwrap();
    let converted = ok(at, "data convert desk timed");
    assert!(
        converted.stderr.contains("desk: no speeds"),
        "{}",
        converted.stderr
    );
    // A drive with both gives no such warning.
    ok(
        at,
        "simulate --out sim --frames 4 --scan-every 0 --size 64x48",
    );
    let whole = ok(at, "data convert sim again");
    assert!(!whole.stderr.contains(": no "), "{}", whole.stderr);
}
