//! A camera from pictures of a board, through the program, and the commands that read the file it writes. The pictures are those of
//! `deepfusion-calibrate` (`tests/reference/boards.py`), whose camera is known.

use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;

use crate::support::{fails, json, ok, run};
use serde_json::Value;

fn boards() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../deepfusion-calibrate/tests/reference")
}

/// A folder with some pictures of a camera in `pictures`.
fn folder(camera: &str, least: usize, most: usize) -> tempfile::TempDir {
    let folder = tempfile::tempdir().unwrap();
    fs::create_dir(folder.path().join("pictures")).unwrap();
    for number in least..most {
        let name = format!("{number:02}.jpg");
        let from = boards().join(camera).join(&name);
        fs::copy(from, folder.path().join("pictures").join(&name)).unwrap();
    }
    folder
}

fn close(value: &Value, expected: f64, tolerance: f64) {
    let value = value.as_f64().unwrap();
    assert!((value - expected).abs() < tolerance, "{value} {expected}");
}

const BOARD: &str = "--board 9x6 --square 0.025";

#[test]
fn a_camera_is_measured_and_its_file_undoes_the_lens() {
    let folder = folder("brown", 0, 9);
    let at = folder.path();
    // A picture without a board is named and does no harm.
    let plain = image::RgbImage::from_pixel(400, 300, image::Rgb([90, 100, 110]));
    plain.save(at.join("pictures/wall.png")).unwrap();
    let report = json(
        at,
        &format!("calibrate pictures {BOARD} --out camera.yaml --report camera.html --json"),
    );
    // The truth of the renderer, within four standard errors and 0.4 %; see the crate's own tests.
    close(&report["intrinsics"]["fx"], 335.0, 1.0);
    close(&report["intrinsics"]["fy"], 332.5, 1.0);
    close(&report["intrinsics"]["cx"], 205.3, 0.8);
    close(&report["intrinsics"]["cy"], 145.8, 0.8);
    close(&report["coefficients"][0], -0.29, 0.006);
    assert_eq!(report["coefficient_names"][4], "k3");
    assert_eq!(report["looked_at"], 10);
    assert_eq!(report["left_out"][0]["name"], "pictures/wall.png");
    assert_eq!(report["left_out"][0]["why"], "no board");
    assert_eq!(report["views"].as_array().unwrap().len(), 9);
    assert!(report["rms_px"].as_f64().unwrap() < 0.1);
    let page = fs::read_to_string(at.join("camera.html")).unwrap();
    assert!(page.contains("Where corners were seen") && page.contains("pictures/08.jpg"));
    // The outputs are not written a second time over the first.
    let again = format!("calibrate pictures {BOARD} --out camera.yaml");
    fails(at, &again, &["camera.yaml", "--overwrite"]);
    let text = ok(at, &format!("{again} --overwrite")).stdout;
    for line in [
        "fx            33",
        "9 of 10 used",
        "wall.png (no board)",
        "camera.yaml",
    ] {
        assert!(text.contains(line), "no `{line}` in\n{text}");
    }

    // `predict` reads the file, and records the camera of the corrected image, which differs from the lens's.
    ok(
        at,
        "predict --model tiny pictures/00.jpg --calib camera.yaml --out depth --save npy",
    );
    let sidecar: Value =
        serde_json::from_slice(&fs::read(at.join("depth/00.json")).unwrap()).unwrap();
    let fx = sidecar["intrinsics"][0].as_f64().unwrap();
    assert!(
        (200.0..500.0).contains(&fx) && (fx - 335.0).abs() > 2.0,
        "{sidecar}"
    );

    // Beside a drive's images the file is found by its name. The folder above is searched, too, hence one deeper.
    let drive = at.join("drives/one");
    fs::create_dir_all(drive.join("images")).unwrap();
    for number in 0..9 {
        let name = format!("{number:02}.jpg");
        fs::copy(
            at.join("pictures").join(&name),
            drive.join("images").join(&name),
        )
        .unwrap();
    }
    fails(
        at,
        "data inspect drives/one",
        &["calibration.yaml", "`deepfusion calibrate`"],
    );
    fs::copy(at.join("camera.yaml"), drive.join("calibration.yaml")).unwrap();
    let inspected = json(at, "data inspect drives/one --json");
    // The corrected image's camera, as `predict` recorded it.
    close(&inspected["intrinsics"]["fx"], fx, 1e-6);
}

#[test]
fn a_fisheye_lens_is_measured() {
    let folder = folder("fisheye", 0, 10);
    let at = folder.path();
    let report = json(
        at,
        &format!("calibrate pictures/*.jpg {BOARD} --fisheye --out fisheye.yml --json"),
    );
    close(&report["intrinsics"]["fx"], 158.0, 0.6);
    close(&report["intrinsics"]["cy"], 147.5, 0.6);
    assert_eq!(report["model"], "fisheye");
    // 203.5 px of θ(1 + 0.031 θ² …) = 1.288 to the left, and 197 px to the right.
    close(&report["hfov_deg"], 139.0, 6.0);
    let written = fs::read_to_string(at.join("fisheye.yml")).unwrap();
    assert!(
        written.contains("distortion_model: equidistant"),
        "{written}"
    );
    ok(
        at,
        "predict --model tiny pictures/00.jpg --calib fisheye.yml --out depth --save npy",
    );
}

/// The camera does not depend on the squares' size, and its file has a default name.
#[test]
fn a_board_is_enough() {
    let root = folder("brown", 0, 9);
    let at = root.path();
    let sized = json(
        at,
        &format!("calibrate pictures {BOARD} --out sized.yaml --json"),
    );
    let plain = json(at, "calibrate pictures --board 9x6 --json");
    for key in ["fx", "fy", "cx", "cy"] {
        let expected = sized["intrinsics"][key].as_f64().unwrap();
        close(&plain["intrinsics"][key], expected, 1e-3);
    }
    assert!(sized["views"][0]["distance_m"].is_f64() && plain["views"][0]["distance_m"].is_null());
    assert!(plain["board"]["square_m"].is_null());
    let read = |name: &str| fs::read_to_string(at.join(name)).unwrap();
    assert!(read("sized.yaml").contains("squares of 0.025 m"));
    assert!(!read("camera.yaml").contains("squares"));
    let printed = ok(
        at,
        "calibrate pictures --board 9x6 --square 25 --out mm.yaml",
    )
    .stderr;
    assert!(printed.contains("in metres, not millimetres"), "{printed}");
}

/// A file with an impossible image size: no memory is allocated for it.
#[test]
fn a_file_for_giant_images_is_an_error() {
    let root = folder("brown", 0, 1);
    let at = root.path();
    let file = "image_width: 4000000000\nimage_height: 4000000000\ncamera_matrix: {rows: 3, cols: 3, data: [4e9, 0, 2e9, 0, 4e9, 2e9, 0, 0, 1]}\n\
                distortion_model: plumb_bob\ndistortion_coefficients: {rows: 1, cols: 5, data: [-0.01, 0, 0, 0, 0]}\n";
    fs::write(at.join("giant.yaml"), file).unwrap();
    fails(
        at,
        "predict --model tiny pictures/00.jpg --calib giant.yaml --out depth",
        &["giant.yaml", "4000000000x4000000000", "400x300"],
    );
}

#[test]
fn every_failure_is_an_error_with_a_hint() {
    let few = folder("brown", 0, 4);
    let at = few.path();
    fails(
        at,
        &format!("calibrate pictures {BOARD} --out c.yaml"),
        &["4 of 4 pictures", "expected at least 5"],
    );
    // The board's squares counted instead of its corners.
    fails(
        at,
        "calibrate pictures --board 10x7 --square 0.025 --out c.yaml",
        &["10x7", "4 of them show a grid of 9x6", "--board 9x6"],
    );
    fails(
        at,
        "calibrate pictures --board 2x6 --square 0.025 --out c.yaml",
        &["2x6", "3 to 100"],
    );
    let wall = image::GrayImage::from_pixel(400, 300, image::Luma([90]));
    fs::create_dir(at.join("walls")).unwrap();
    for i in 0..6 {
        wall.save(at.join(format!("walls/{i}.png"))).unwrap();
    }
    fails(
        at,
        &format!("calibrate walls {BOARD} --out c.yaml"),
        &["found in 6 pictures", "10x7 squares has 9x6"],
    );
    // A picture of another size, and one that EXIF rotates.
    fs::copy(boards().join("plain/00.jpg"), at.join("pictures/small.jpg")).unwrap();
    fails(
        at,
        &format!("calibrate pictures {BOARD} --out c.yaml"),
        &["small.jpg", "320x240", "400x300"],
    );
    let plain = fs::read(boards().join("brown/05.jpg")).unwrap();
    let exif = b"Exif\0\0MM\0\x2a\0\0\0\x08\0\x01\x01\x12\0\x03\0\0\0\x01\0\x03\0\0\0\0\0\0";
    let length = u16::try_from(exif.len() + 2).unwrap().to_be_bytes();
    let turned = [&plain[..2], &[0xFF, 0xE1], &length, exif, &plain[2..]].concat();
    fs::write(at.join("pictures/small.jpg"), turned).unwrap();
    fails(
        at,
        &format!("calibrate pictures {BOARD} --out c.yaml"),
        &["small.jpg", "180 degrees", "held one way"],
    );
    fails(
        at,
        &format!("calibrate pictures/03.jpg nowhere.jpg {BOARD} --out c.yaml"),
        &["nowhere.jpg"],
    );
    assert!(!at.join("c.yaml").exists());
    let wrong = run(at, &format!("calibrate pictures {BOARD} --out c.txt"));
    assert!(
        wrong.code == 2 && wrong.stderr.contains("camera.yaml"),
        "{}",
        wrong.stderr
    );
}

/// A video with every picture four times, some of them blurred: each pose is used once.
#[test]
fn a_videos_frames_are_picked() {
    for program in ["ffmpeg", "ffprobe"] {
        if Command::new(program).arg("-version").output().is_err() {
            eprintln!("skipped: there is no {program} for videos");
            return;
        }
    }
    let folder = folder("brown", 0, 9);
    let at = folder.path();
    let mut number = 0;
    fs::create_dir(at.join("frames")).unwrap();
    for picture in 0..9 {
        let image = image::open(at.join(format!("pictures/{picture:02}.jpg"))).unwrap();
        for repeat in 0..4 {
            let frame = if repeat == 2 {
                image.clone()
            } else {
                image.blur(1.0)
            };
            frame
                .save(at.join(format!("frames/{number:03}.png")))
                .unwrap();
            number += 1;
        }
    }
    let made = Command::new("ffmpeg")
        .current_dir(at)
        .args("-v error -framerate 10 -i frames/%03d.png -c:v mpeg4 -q:v 1 board.mp4".split(' '))
        .status()
        .unwrap();
    assert!(made.success());
    let report = json(
        at,
        &format!("calibrate board.mp4 {BOARD} --out camera.yaml --json"),
    );
    assert_eq!(report["looked_at"], 36);
    assert_eq!(report["views"].as_array().unwrap().len(), 9);
    assert_eq!(report["not_picked"], 27);
    close(&report["intrinsics"]["fx"], 335.0, 1.5);
    let few = json(
        at,
        &format!("calibrate board.mp4 {BOARD} --frames 6 --out few.yaml --json"),
    );
    assert_eq!(few["views"].as_array().unwrap().len(), 6);
}
