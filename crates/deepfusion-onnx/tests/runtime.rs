//! Files in ONNX Runtime, if this machine has one; else the error messages.

#![cfg(feature = "runtime")]

use std::path::Path;

use crate::support::model;
use deepfusion_geometry::DepthRange;
use deepfusion_hint::Hint;
use deepfusion_infer::{Activation, Border, Conv, Graph, Op, ValueId};
use deepfusion_onnx::check::{deviation, pictures};
use deepfusion_onnx::runtime::{OrtEngine, find};
use deepfusion_onnx::{DepthMaps, DepthModel, Error, reference, write};

/// Whether a library is found; if not, the error is checked and printed.
fn library_is_here() -> bool {
    match find(None) {
        Ok(library) => {
            eprintln!(
                "ONNX Runtime {} at {}",
                library.version,
                library.path.display()
            );
            true
        }
        Err(error) => {
            let hint = error.hint().unwrap();
            assert!(
                hint.contains("ORT_DYLIB_PATH") || hint.contains("1.17"),
                "{hint}"
            );
            let loaded = OrtEngine::load(None, &write(&model(1)).unwrap(), 1);
            assert_eq!(loaded.unwrap_err().to_string(), error.to_string());
            eprintln!("not run here: {error}");
            false
        }
    }
}

#[test]
fn random_networks_equal_the_reference() {
    if !library_is_here() {
        return;
    }
    let mut worst = 0.0_f64;
    for seed in 0..40 {
        let model = model(seed);
        let mut engine = OrtEngine::load(None, &write(&model).unwrap(), 1).unwrap();
        assert_eq!(engine.size(), [model.width, model.height]);
        let pictures = pictures(model.width, model.height);
        let found: Vec<_> = pictures.iter().map(|p| engine.maps(p).unwrap()).collect();
        let expected: Vec<_> = pictures
            .iter()
            .map(|p| reference::depth(&model, p).unwrap())
            .collect();
        let apart = deviation(&found, &expected);
        worst = worst.max(apart.worst());
        assert!(apart.worst() < 5e-6, "seed {seed}: {apart:?}");
        // Disparity alone gives the same values.
        let mut alone = vec![0.0; model.width * model.height];
        engine.run(&pictures[0], &mut alone).unwrap();
        assert_eq!(alone, found[0].disparity);
        let inverse = |maps: &DepthMaps| {
            maps.depth
                .iter()
                .zip(&maps.disparity)
                .all(|(z, d)| (z * d - 1.0).abs() < 1e-6)
        };
        assert!(found.iter().all(inverse));
    }
    eprintln!("largest deviation {worst:.1e}");
}

/// ONNX Runtime's own `Sigmoid` would be off by 1e-4 here: at the far end σ is nearly 0, and its error counts 900-fold.
#[test]
fn the_far_end_of_the_range_is_exact() {
    if !library_is_here() {
        return;
    }
    let mut graph = Graph::new([0.0; 3], [1.0; 3]);
    let head = Conv {
        input: ValueId::IMAGE,
        weight: vec![14.0, 0.0, 0.0],
        bias: vec![-18.0],
        channels_in: 3,
        channels_out: 1,
        kernel: 1,
        stride: 1,
        dilation: 1,
        border: Border::Zero,
        residual: None,
        activation: Activation::Sigmoid,
    };
    let output = graph.push("head", Op::Conv(Box::new(head))).unwrap();
    graph.add_output(output);
    let range = DepthRange::default();
    let (width, height) = (16, 16);
    let model = DepthModel {
        graph,
        range,
        width,
        height,
        trained_with: None,
        canonical: false,
    };
    let mut engine = OrtEngine::load(None, &write(&model).unwrap(), 1).unwrap();
    let rgb: Vec<u8> = (0..=255).flat_map(|red| [red, 0, 0]).collect();
    let found = engine.maps(&rgb).unwrap();
    for (red, depth) in found.depth.iter().enumerate() {
        let x = 14.0 * red as f64 / 255.0 - 18.0;
        let expected = range.depth_m(1.0 / (1.0 + (-x).exp()));
        assert!(
            (f64::from(*depth) / expected - 1.0).abs() < 3e-6,
            "{red}: {depth} {expected}"
        );
    }
}

/// Images are prepared on one thread and run on another.
#[test]
fn engines_move_between_threads() {
    fn is_send<T: Send>() {}
    is_send::<OrtEngine>();
}

#[test]
fn wrong_sizes_and_models_are_refused() {
    if !library_is_here() {
        return;
    }
    let model = model(3);
    let bytes = write(&model).unwrap();
    let mut engine = OrtEngine::load(None, &bytes, 0).unwrap();
    let pixels = model.width * model.height;
    let mut out = vec![0.0; pixels];
    for (rgb, len) in [(3 * pixels - 1, pixels), (3 * pixels, pixels - 1), (0, 0)] {
        let error = engine.run(&vec![0; rgb], &mut out[..len]);
        assert!(matches!(error, Err(Error::Length { .. })), "{error:?}");
    }
    assert!(engine.run(&vec![0; 3 * pixels], &mut out).is_ok());
    for bad in [&bytes[..bytes.len() / 2], b"no onnx", b""] {
        let error = OrtEngine::load(None, bad, 1);
        assert!(matches!(error, Err(Error::Runtime { .. })), "{error:?}");
    }
    // No other library can be used while one is open.
    let other = OrtEngine::load(Some(Path::new("/nowhere/libonnxruntime.so")), &bytes, 1);
    assert!(matches!(other, Err(Error::Library { .. })), "{other:?}");
}

#[test]
fn files_that_are_no_library_are_named() {
    let folder = tempfile::tempdir().unwrap();
    let text = folder.path().join("libonnxruntime.so");
    std::fs::write(&text, "no library").unwrap();
    // A library, but not ONNX Runtime: this test itself is linked against it.
    let mut wrong = vec![
        text,
        folder.path().to_owned(),
        folder.path().join("none.so"),
    ];
    let libc = [
        "/lib/x86_64-linux-gnu/libc.so.6",
        "/lib64/libc.so.6",
        "/usr/lib/libc.so.6",
    ];
    wrong.extend(
        libc.map(Into::into)
            .into_iter()
            .find(|p: &std::path::PathBuf| p.exists()),
    );
    for path in wrong {
        let error = find(Some(&path)).unwrap_err();
        assert!(
            error.to_string().starts_with(path.to_str().unwrap()),
            "{error}"
        );
        assert!(error.hint().unwrap().contains("1.17"), "{error}");
    }
}

/// Libraries with the right entry point that are nevertheless unusable: too old, or damaged.
#[test]
fn unusable_versions_are_reported() {
    let folder = tempfile::tempdir().unwrap();
    for (name, version, entry) in [("old", "1.16.3", "&base"), ("null", "1.20.0", "0")] {
        let source = format!(
            "static const void* api(unsigned v) {{ return 0; }}\n\
             static const char* version(void) {{ return \"{version}\"; }}\n\
             static const struct {{ void* a; void* b; }} base = {{ (void*)api, (void*)version }};\n\
             const void* OrtGetApiBase(void) {{ return {entry}; }}\n"
        );
        let (c, so) = (
            folder.path().join(format!("{name}.c")),
            folder.path().join(format!("{name}.so")),
        );
        std::fs::write(&c, source).unwrap();
        let mut compiler = std::process::Command::new("cc");
        let made = compiler
            .args(["-shared", "-fPIC", "-w", "-o"])
            .args([&so, &c])
            .status();
        if !made.is_ok_and(|status| status.success()) {
            eprintln!("not run here: no C compiler");
            return;
        }
        let error = find(Some(&so)).unwrap_err().to_string();
        let expected = if name == "old" {
            "it is version 1.16.3, expected 1.17 or later"
        } else {
            "returns nothing"
        };
        assert!(error.contains(expected), "{error}");
    }
}
