//! The paper's network from configuration to file: training, resuming, prediction in both engines, features, export.

use std::fs;

use crate::support::ok;
use deepfusion_onnx::read;
use serde_json::Value;

/// The preset `tiny` with every part of the paper's network.
fn with_parts(config: &str) -> String {
    let whole = config.replacen("aggregation = false", "aggregation = true", 1);
    // The depth network's encoder comes before the pose network's.
    let start = whole.find("[depth_net.encoder]").unwrap();
    let (before, encoder) = whole.split_at(start);
    let encoder = encoder.replacen("output_stride = 32", "output_stride = 16", 1);
    let changed = format!(
        "{before}{encoder}\n[depth_net.hce]\nrates = [2, 4]\n\n[depth_net.attention]\nform = \"residual\"\n"
    );
    assert_eq!(
        changed.matches("= true").count(),
        config.matches("= true").count() + 1
    );
    assert_eq!(changed.matches("output_stride = 16").count(), 1);
    changed
}

#[test]
fn a_run_with_every_part_of_the_network() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    ok(
        at,
        "simulate --out sim --frames 8 --seed 3 --scan-every 0 --size 96x64",
    );
    ok(
        at,
        "train --data sim --size 96x64 --batch 2 --steps 1 --init none --out plain",
    );
    let config = fs::read_to_string(at.join("plain/config.toml")).unwrap();
    fs::write(at.join("parts.toml"), with_parts(&config)).unwrap();
    ok(
        at,
        "train --data sim --config parts.toml --steps 2 --out run",
    );
    ok(at, "train --resume --data sim --steps 3 --out run");

    // Both engines give the same result.
    let image = "sim/2026_01_01/2026_01_01_drive_0003_sync/image_02/data/0000000004.png";
    for engine in ["burn", "fused"] {
        let args = format!(
            "predict --model run {image} --save npy,features --engine {engine} --out {engine}"
        );
        ok(at, &args);
    }
    let depth = |engine: &str| -> Vec<f32> {
        let file = fs::read(at.join(engine).join("0000000004_depth.npy")).unwrap();
        // The numbers follow a header.
        let numbers = &file[file.len() - 4 * 96 * 64..];
        let number = |b: &[u8]| f32::from_le_bytes(b.try_into().unwrap());
        numbers.chunks_exact(4).map(number).collect()
    };
    for (burn, fused) in depth("burn").iter().zip(depth("fused")) {
        assert!((burn / fused - 1.0).abs() < 1e-3, "{burn} {fused}");
    }

    // Image and depth, then for each layer a feature, the decoder's input and a mask, in three columns.
    let size = |engine: &str| {
        let picture = image::open(at.join(engine).join("0000000004_features.png")).unwrap();
        (picture.width(), picture.height())
    };
    assert_eq!(size("burn"), size("fused"));
    let (width, height) = size("fused");
    assert!(width > 3 * 480 && height > 5 * 320, "{width}x{height}");
    // Without the parts only the features, in two columns.
    ok(
        at,
        &format!("predict --model plain {image} --save features --out plain_features"),
    );
    assert!(size("plain_features").0 < 3 * 480);

    let export = ok(at, "export --model run --out depth.onnx --json");
    let report: Value = serde_json::from_str(&export.stdout).unwrap();
    for check in report["checks"].as_array().unwrap() {
        assert!(check["depth_deviation"].as_f64().unwrap() < 1e-4, "{check}");
    }
    let model = read(&fs::read(at.join("depth.onnx")).unwrap()).unwrap();
    let names: Vec<&str> = model
        .graph
        .nodes()
        .iter()
        .map(|n| n.name.as_str())
        .collect();
    for name in [
        "hce.0.dilated.1.conv",
        "attention.3.gate",
        "aggregation.add",
    ] {
        assert!(names.contains(&name), "{name} in {names:?}");
    }

    let bench = ok(at, "bench --model run --repeats 1 --json");
    let bench: Value = serde_json::from_str(&bench.stdout).unwrap();
    let modules = bench["modules"].as_array().unwrap();
    assert!(modules.iter().any(|m| m["name"] == "hce.3"));
}
