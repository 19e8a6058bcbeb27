//! Targets through the program.

use std::path::Path;

use crate::support::{fails, json, ok, run};
use serde_json::Value;

const DRIVE: &str = "street/2026_01_01/2026_01_01_drive_0005_sync";

/// A street with traffic, as a drive and as a bag, and a network trained on it for a few steps.
fn street(folder: &Path) {
    ok(
        folder,
        "simulate --out street --frames 12 --seed 5 --moving-cars 6 --size 320x96",
    );
    ok(
        folder,
        "train --data street --preset tiny --size 128x64 --batch 2 --steps 3 --init none --out run",
    );
}

#[test]
fn a_drive_becomes_targets_frame_by_frame() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    street(at);
    let args = format!(
        "perceive --model run {DRIVE} --out targets --save depth-png,overlay,birds-eye,segments,ply,pcd --json"
    );
    let printed = ok(at, &args);
    let lines: Vec<Value> = printed
        .stdout
        .lines()
        .map(|line| serde_json::from_str(line).unwrap())
        .collect();
    assert_eq!(lines.len(), 12);
    let file = std::fs::read_to_string(at.join("targets/targets.jsonl")).unwrap();
    assert_eq!(file, printed.stdout);
    for (i, line) in lines.iter().enumerate() {
        let name = format!("{i:010}");
        assert_eq!(line["frame"], name.as_str());
        assert!(line["targets"].is_array());
        assert!(line["time_s"].as_f64().unwrap() >= 0.0);
        assert!(line["speed_mps"].as_f64().unwrap() > 1.0);
        assert_eq!(line["camera_motion"].as_array().unwrap().len(), 12);
        assert!(line["latency_ms"].as_f64().unwrap() > 0.0);
        for ending in [
            "_targets.json",
            "_depth.png",
            "_overlay.png",
            "_segments.png",
            ".ply",
            ".pcd",
            ".json",
        ] {
            let path = at.join(format!("targets/{name}{ending}"));
            assert!(path.is_file(), "{}", path.display());
        }
        let own: Value = serde_json::from_str(
            &std::fs::read_to_string(at.join(format!("targets/{name}_targets.json"))).unwrap(),
        )
        .unwrap();
        assert_eq!(&own, line);
    }
    // The first camera's axes are the world's; the last camera has moved forward.
    let place = |line: &Value, k: usize| line["camera_motion"][4 * k + 3].as_f64().unwrap();
    assert_eq!(place(&lines[0], 2), 0.0);
    assert!(place(&lines[11], 2) > 3.0);
    // No file is overwritten unasked.
    let again = run(at, &args);
    assert_eq!(again.code, 1);
    assert!(again.stderr.contains("already exists") && again.stderr.contains("--overwrite"));
    ok(at, &format!("{args} --overwrite"));
}

#[test]
fn single_images_and_bags_become_targets() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    street(at);
    let image = format!("{DRIVE}/image_02/data/0000000003.png");
    let line = ok(
        at,
        &format!("perceive --model run {image} --intrinsics 186,186,157,44 --out one --json"),
    );
    let record: Value = serde_json::from_str(line.stdout.trim()).unwrap();
    assert!(record["camera_motion"].is_null() && record["scale_monitor"].is_null());
    ok(
        at,
        "simulate --out bag --format bag --frames 4 --size 96x64 --moving-cars 2",
    );
    let printed = ok(
        at,
        "perceive --model run bag/urban_0001.bag --out seen --json",
    );
    assert_eq!(printed.stdout.lines().count(), 4);
    assert!(at.join("seen/0000000002_image.jpg").is_file());
    // `predict` takes recordings too, with their cameras.
    ok(at, "predict --model run bag/urban_0001.bag --out depth");
    let sidecar: Value =
        serde_json::from_str(&std::fs::read_to_string(at.join("depth/0000000002.json")).unwrap())
            .unwrap();
    assert_eq!(sidecar["intrinsics_from"], "recording");
    assert_eq!(sidecar["camera_known"], true);
}

#[test]
fn a_calibrated_run_gives_its_clouds_a_confidence() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    street(at);
    let image = format!("{DRIVE}/image_02/data/0000000003.png");
    let cloud = |out: &str| {
        ok(
            at,
            &format!(
                "perceive --model run {image} --intrinsics 186,186,157,44 --save ply --out {out}"
            ),
        );
        let bytes = std::fs::read(at.join(out).join("0000000003.ply")).unwrap();
        String::from_utf8_lossy(&bytes[..400]).into_owned()
    };
    assert!(!cloud("before").contains("confidence"));
    ok(
        at,
        "eval --model run --data street --crop none --calibrate-confidence --report page.html",
    );
    let file = std::fs::read_to_string(at.join("run/confidence.toml")).unwrap();
    let file: toml::Table = file.parse().unwrap();
    for look in ["single", "mirrored"] {
        let weight = |name: &str| file[look][name].as_float().unwrap();
        assert!(
            ["constant", "gradient", "flip"]
                .iter()
                .all(|n| weight(n) >= 0.0),
            "{file}"
        );
    }
    let page = std::fs::read_to_string(at.join("page.html")).unwrap();
    assert!(page.contains("How far to trust a pixel"));
    assert!(cloud("after").contains("property float confidence"));
    // A malformed file is an error and not ignored.
    std::fs::write(at.join("run/confidence.toml"), "single = 3").unwrap();
    let run_ = run(
        at,
        &format!("perceive --model run {image} --intrinsics 186,186,157,44 --out wrong"),
    );
    assert_eq!(run_.code, 1);
    assert!(run_.stderr.contains("confidence.toml"), "{}", run_.stderr);
}

#[test]
fn a_calibration_tools_file_gives_camera_and_lens() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    street(at);
    let image = format!("{DRIVE}/image_02/data/0000000003.png");
    let yaml = |width: u32| {
        format!(
            "image_width: {width}\nimage_height: 96\ncamera_matrix:\n  rows: 3\n  cols: 3\n  data: [186, 0, 157, 0, 186, 44, 0, 0, 1]\n\
             distortion_model: plumb_bob\ndistortion_coefficients:\n  rows: 1\n  cols: 5\n  data: [-0.2, 0.03, 0, 0, 0]\n"
        )
    };
    std::fs::write(at.join("camera.yaml"), yaml(320)).unwrap();
    ok(
        at,
        &format!("predict --model run {image} --calib camera.yaml --out depth"),
    );
    let sidecar: Value =
        serde_json::from_str(&std::fs::read_to_string(at.join("depth/0000000003.json")).unwrap())
            .unwrap();
    assert_eq!(sidecar["intrinsics_from"], "given");
    assert!(sidecar["made_with"]["calibration_sha256"].is_string());
    let fx = sidecar["intrinsics"][0].as_f64().unwrap();
    assert!((100.0..186.1).contains(&fx), "{fx}");
    // With another file the outputs differ.
    std::fs::write(at.join("camera.yaml"), yaml(320) + "# touched\n").unwrap();
    let args = format!("predict --model run {image} --calib camera.yaml --out depth");
    let again = run(at, &args);
    assert!(
        again.code == 1 && again.stderr.contains("another camera"),
        "{}",
        again.stderr
    );
    // A calibration for another image size is refused.
    std::fs::write(at.join("camera.yaml"), yaml(640)).unwrap();
    let wrong = run(at, &format!("{args} --overwrite"));
    assert_eq!(wrong.code, 1);
    assert!(
        wrong.stderr.contains("640x96") && wrong.stderr.contains("320x96"),
        "{}",
        wrong.stderr
    );
}

#[test]
fn exact_depth_finds_the_simulators_boxes() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    ok(
        at,
        "simulate --out street --frames 14 --seed 6 --moving-cars 6",
    );
    let printed = ok(
        at,
        "eval-targets --data street --depth truth --json --out pictures",
    );
    let score: Value = serde_json::from_str(&printed.stdout).unwrap();
    assert_eq!(
        (&score["depth"], &score["frames"]),
        (&"truth".into(), &14.into())
    );
    assert!(score["labels"].as_u64().unwrap() > 30, "{score}");
    assert!(score["recall"].as_f64().unwrap() > 0.8, "{score}");
    assert!(score["precision"].as_f64().unwrap() > 0.8, "{score}");
    assert!(score["center_error_m"].as_f64().unwrap() < 0.5, "{score}");
    assert_eq!(std::fs::read_dir(at.join("pictures")).unwrap().count(), 14);
    let lidar = ok(at, "eval-targets --data street --depth lidar").stdout;
    assert!(lidar.contains("targets from lidar depth"), "{lidar}");
}

/// A report of targets states which predictions their depth is the mean of. Targets of so few frames may not differ; that the option reaches
/// the network is tested in [`errors_name_their_cause`], where a network of a single size refuses it.
#[test]
fn a_report_states_which_predictions_its_depth_is_the_mean_of() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    ok(
        at,
        "simulate --out street --frames 3 --seed 6 --moving-cars 6 --size 320x96",
    );
    let eval = "eval-targets --data street --model tiny";
    let plain = json(at, &format!("{eval} --json"));
    let blended = json(at, &format!("{eval} --post-process flip --json"));
    assert_eq!(plain.get("post_process"), None);
    assert_eq!(blended["post_process"], "flip");
    for key in ["depth", "frames", "labels"] {
        assert_eq!(blended[key], plain[key], "{key}");
    }
    assert_eq!(blended["frames"], 3);
    let text = ok(at, &format!("{eval} --post-process multi-scale")).stdout;
    let head = "targets from predicted (multi-scale) depth, 3 frames";
    assert!(text.starts_with(head), "{text}");
    // Measured depth is not a mean of predictions.
    let measured = "eval-targets --data street --depth truth --post-process flip";
    assert_eq!(run(at, measured).code, 2);
}

/// A model from the tests of the crate `deepfusion-instances`.
fn model(name: &str) -> String {
    let crates = Path::new(env!("CARGO_MANIFEST_DIR")).parent().unwrap();
    let path = crates.join(format!("deepfusion-instances/tests/reference/{name}.onnx"));
    path.to_str().unwrap().to_owned()
}

#[test]
fn a_users_model_gives_targets_their_class() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    street(at);
    let with = |name: &str, more: &str| {
        format!(
            "perceive --model run {DRIVE} --out {name} --save overlay --json --instances {} {more}",
            model(name)
        )
    };
    fails(at, &with("missing", ""), &["missing.onnx"]);
    let without = run(
        at,
        &format!("perceive --model run {DRIVE} --out x --classes car"),
    );
    assert!(
        without.code == 2 && without.stderr.contains("--instances"),
        "{}",
        without.stderr
    );
    if deepfusion_onnx::runtime::find(None).is_err() {
        eprintln!("no ONNX Runtime library on this machine: models are not run");
        return;
    }
    fails(
        at,
        &with("no_detector", ""),
        &["no_detector.onnx", "1x1x64x64"],
    );
    fails(
        at,
        &with("red_things", "--classes cat"),
        &["no class `cat`"],
    );
    assert!(
        !at.join("no_detector").exists(),
        "nothing is started with an invalid model"
    );
    let printed = ok(at, &with("red_things", "--instance-score 0.5"));
    for line in printed.stdout.lines() {
        let record: Value = serde_json::from_str(line).unwrap();
        for target in record["targets"].as_array().unwrap() {
            let class = &target["class"];
            assert!(
                class.is_null() || class == "left" || class == "right",
                "{class}"
            );
        }
    }
}

#[test]
fn errors_name_their_cause() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    street(at);
    let cases = [
        ("perceive --model run nowhere.png --out a", "nowhere.png"),
        ("perceive --model run street.mp4x --out b", "street.mp4x"),
        ("eval-targets --data street --model nowhere", "nowhere"),
        (
            "eval-targets --data street --model run --post-process multi-scale",
            "canonical focal length",
        ),
    ];
    for (args, named) in cases {
        let run = run(at, args);
        assert_eq!(run.code, 1, "{args}");
        assert!(run.stderr.contains(named), "{args}: {}", run.stderr);
        assert!(run.stderr.contains("hint:"), "{args}: {}", run.stderr);
    }
    // No frame was processed, so nothing blocks the next attempt.
    assert!(!at.join("a/targets.jsonl").exists());
    // Files that another command wrote there remain.
    let picture = format!("{DRIVE}/image_02/data/0000000003.png --intrinsics 186,186,157,44");
    ok(at, &format!("predict --model run {picture} --out theirs"));
    let depth = || std::fs::read(at.join("theirs/0000000003_depth.png")).unwrap();
    let before = depth();
    let perceive = format!("perceive --model run {picture} --out theirs");
    fails(at, &perceive, &["0000000003", "already exists"]);
    assert!(depth() == before);
    fails(
        at,
        &format!("predict --model run {picture} --out theirs/0000000003_depth.png"),
        &["expected a folder for the outputs", "--out"],
    );
    std::fs::write(at.join("wrong.toml"), "min_pixel = 3\n").unwrap();
    let args = format!("perceive --model run {DRIVE} --out c --config wrong.toml");
    let run_ = run(at, &args);
    assert_eq!(run_.code, 1);
    assert!(
        [
            "wrong.toml",
            "unknown field `min_pixel`",
            "hint: correct the setting",
            "max_depth_m"
        ]
        .iter()
        .all(|part| run_.stderr.contains(part)),
        "{}",
        run_.stderr
    );
    // The parser's message appears once, and not again as its own cause.
    assert_eq!(run_.stderr.matches("unknown field").count(), 1);
    assert!(!run_.stderr.contains("because:"), "{}", run_.stderr);
    // A drive without labelled boxes.
    std::fs::remove_file(at.join(DRIVE).join("tracklet_labels.xml")).unwrap();
    let run_ = run(at, "eval-targets --data street --depth truth");
    assert_eq!(run_.code, 1);
    assert!(
        run_.stderr.contains("tracklet_labels.xml"),
        "{}",
        run_.stderr
    );
    // A broken image among good ones is left out and named.
    std::fs::write(
        at.join(DRIVE).join("image_02/data/0000000004.png"),
        b"no picture",
    )
    .unwrap();
    let images = format!("{DRIVE}/image_02/data");
    let run_ = run(
        at,
        &format!("perceive --model run {images} --intrinsics 186,186,157,44 --out d"),
    );
    assert_eq!(run_.code, 1);
    for part in ["0000000004.png", "run it again with --overwrite"] {
        assert!(run_.stderr.contains(part), "{part}: {}", run_.stderr);
    }
    let lines = std::fs::read_to_string(at.join("d/targets.jsonl")).unwrap();
    assert_eq!(lines.lines().count(), 11);
}
