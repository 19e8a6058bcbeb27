//! `deepfusion export`: what it writes, checks and refuses.

use std::fs;

use crate::support::run;
use deepfusion_onnx::runtime::find;
use deepfusion_onnx::{OPSET, read};
use serde_json::Value;

#[test]
fn an_exported_file_computes_what_the_network_does() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    for args in [
        "simulate --out sim --frames 8 --seed 3 --scan-every 0",
        "train --data sim --size 96x64 --batch 2 --steps 1 --init none --out run",
    ] {
        let done = run(at, args);
        assert_eq!(done.code, 0, "{args}: {}", done.stderr);
    }

    let done = run(at, "export --model run --out depth.onnx --json");
    assert_eq!(done.code, 0, "{}", done.stderr);
    let report: Value = serde_json::from_str(&done.stdout).unwrap();
    let bytes = fs::read(at.join("depth.onnx")).unwrap();
    assert_eq!(report["bytes"], bytes.len());
    assert_eq!(report["opset"], OPSET);
    assert_eq!(report["size"], serde_json::json!([96, 64]));
    let checks = report["checks"].as_array().unwrap();
    assert_eq!(checks.len(), 1 + usize::from(find(None).is_ok()));
    for check in checks {
        assert!(check["depth_deviation"].as_f64().unwrap() < 1e-4, "{check}");
        assert!(
            check["disparity_deviation"].as_f64().unwrap() < 1e-4,
            "{check}"
        );
    }
    let model = read(&bytes).unwrap();
    assert_eq!((model.width, model.height), (96, 64));
    assert_eq!(
        model.trained_with.map(|k| k.fy),
        report["training_fy_px"].as_f64()
    );
    assert!(model.trained_with.is_some() && !model.canonical);
    assert_eq!(report["canonical_fy_px"], serde_json::Value::Null);

    // Another size: the same weights, the same training camera.
    let done = run(
        at,
        "export --model run/last.safetensors --out wide.onnx --size 128x64",
    );
    assert_eq!(
        (done.code, done.stdout.as_str()),
        (0, "wide.onnx\n"),
        "{}",
        done.stderr
    );
    assert!(
        done.stderr.contains("checked with this program"),
        "{}",
        done.stderr
    );
    let wide = read(&fs::read(at.join("wide.onnx")).unwrap()).unwrap();
    assert_eq!((wide.width, wide.height), (128, 64));
    assert_eq!(wide.graph, model.graph);
    assert_eq!(wide.trained_with, model.trained_with);

    // No file is overwritten unasked, and a failure leaves no files behind.
    fs::write(at.join("text.so"), "no library").unwrap();
    fs::create_dir(at.join("folder.onnx")).unwrap();
    let files = || {
        let mut names: Vec<_> = fs::read_dir(at)
            .unwrap()
            .map(|e| e.unwrap().file_name())
            .collect();
        names.sort();
        names
    };
    let before = files();
    for (args, named) in [
        ("--model run --out depth.onnx", "depth.onnx"),
        ("--model run --out folder.onnx --overwrite", "folder.onnx"),
        ("--model sim --out new.onnx", "sim"),
        ("--model run --out new.onnx --size 100x64", "100x64"),
        ("--model run --out new.onnx --check-with text.so", "text.so"),
        ("--model run --out new.onnx --check-with none.so", "none.so"),
        ("--model run --out no/folder/new.onnx", "no/folder"),
    ] {
        let done = run(at, &format!("export {args}"));
        assert_eq!((done.code, done.stdout.as_str()), (1, ""), "{args}");
        assert!(done.stderr.contains(named), "{args}: {}", done.stderr);
        assert!(done.stderr.contains("hint: "), "{args}: {}", done.stderr);
        assert_eq!(files(), before, "{args}");
    }
    assert_eq!(fs::read(at.join("depth.onnx")).unwrap(), bytes);
    let done = run(
        at,
        "export --model run --out depth.onnx --overwrite --size 64x64",
    );
    assert_eq!(done.code, 0, "{}", done.stderr);
    assert_ne!(fs::read(at.join("depth.onnx")).unwrap(), bytes);
    assert_eq!(files(), before);
}
