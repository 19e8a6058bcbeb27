//! Int8: calibrated on the user's images, refused if the calibration is missing or stale, close to f32 otherwise.

use std::fs;

use crate::support::{fails, json, ok, run};
use deepfusion_infer::Engine;

const CALIBRATE: &str = "weights calibrate --images 4";

#[test]
fn a_network_is_calibrated_and_measured_in_int8() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    ok(
        at,
        "simulate --out sim --frames 6 --seed 3 --scan-every 2 --size 320x96",
    );
    // The embedded network's depth is good enough to be harmed by int8.
    ok(
        at,
        "train --data sim --preset tiny --size 320x96 --batch 2 --steps 1 --set learning_rate=1e-6 --out run",
    );
    let eval = "eval --model run --data sim --json --precision";
    let exact = json(at, &format!("{eval} f32"));
    if !Engine::has_int8() {
        fails(at, &format!("{eval} int8"), &["engine", "AVX512-VNNI"]);
        let calibrate = format!("{CALIBRATE} --model run sim");
        fails(at, &calibrate, &["engine", "AVX512-VNNI"]);
        return;
    }
    fails(
        at,
        &format!("{eval} int8"),
        &["not calibrated", "hint: ", "weights calibrate --model RUN"],
    );
    let found = json(at, &format!("{CALIBRATE} --model run sim --json"));
    assert_eq!((&found["images"], &found["step"]), (&4.into(), &1.into()));
    let ranges = found["ranges"].as_object().unwrap();
    assert!(ranges.len() > 20, "{found}");
    assert!(at.join("run/int8.toml").exists());
    let in_int8 = json(at, &format!("{eval} int8"));
    let abs_rel = |of: &serde_json::Value| of["unscaled"]["abs_rel"].as_f64().unwrap();
    let (exact, rough) = (abs_rel(&exact), abs_rel(&in_int8));
    assert!(exact != rough, "int8 rounds: {exact}");
    assert!((rough - exact).abs() < 0.02, "{exact} and {rough}");
    let report = json(
        at,
        "bench --model run --precision int8 --repeats 1 --profile --json",
    );
    assert_eq!(report["engine"], "fused-int8");
    let steps = report["profile_ms"].as_array().unwrap();
    let count = steps
        .iter()
        .filter(|step| step[0].as_str().unwrap().ends_with(" int8"));
    assert!(count.count() > 15, "{report}");

    // A packed network's card contains the ranges.
    ok(at, "weights pack --model run --name hut --out packed");
    let model = "--model packed/hut.safetensors";
    let packed = json(
        at,
        &format!("eval {model} --data sim --json --precision int8"),
    );
    assert!((abs_rel(&packed) - rough).abs() < 0.01, "{packed}");
    let card = fs::read_to_string(at.join("packed/hut.toml")).unwrap();
    let bare = card.split("[int8]").next().unwrap();
    let config = &card[card.find("[config]").unwrap()..];
    fs::write(at.join("packed/hut.toml"), format!("{bare}{config}")).unwrap();
    let predict = format!("predict sim {model} --precision int8 --out depth");
    fails(at, &predict, &["not calibrated"]);
    ok(at, &format!("{CALIBRATE} {model} sim"));
    ok(at, &predict);

    // Ranges of another step are refused.
    let stale = fs::read_to_string(at.join("run/int8.toml")).unwrap();
    fs::write(
        at.join("run/int8.toml"),
        stale.replace("step = 1", "step = 2"),
    )
    .unwrap();
    fails(at, &format!("{eval} int8"), &["not calibrated"]);
    fs::write(at.join("run/int8.toml"), "step = 1").unwrap();
    fails(at, &format!("{eval} int8"), &["int8.toml"]);
    // Other engines ignore them, and they can be written again.
    ok(at, &format!("{eval} f32"));
    fails(
        at,
        &format!("{CALIBRATE} --model run sim --most-deviation 0"),
        &["int8", "an earlier calibration stays"],
    );
    ok(at, &format!("{CALIBRATE} --model run sim"));
    ok(at, &format!("{eval} int8"));
    // A prediction with another calibration counts as a different one.
    ok(at, &format!("{CALIBRATE} {model} sim --most-deviation 1"));
    fails(at, &predict, &["depth"]);
}

#[test]
fn a_network_that_cannot_be_calibrated_is_an_error() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    fs::create_dir(at.join("empty")).unwrap();
    fails(
        at,
        &format!("{CALIBRATE} --model tiny empty"),
        &["embedded"],
    );
    fails(
        at,
        &format!("{CALIBRATE} --model nowhere empty"),
        &["nowhere"],
    );
    let none = run(at, "weights calibrate --model tiny --images 0 empty");
    assert_eq!(none.code, 2, "{}", none.stderr);
}

/// The embedded default network needs no calibration by the user.
#[test]
fn embedded_networks_come_calibrated() {
    if !Engine::has_int8() {
        return;
    }
    let folder = tempfile::tempdir().unwrap();
    for name in deepfusion_runtime::embedded_names() {
        let report = json(
            folder.path(),
            &format!("bench --model {name} --precision int8 --repeats 1 --json"),
        );
        assert_eq!(report["engine"], "fused-int8");
    }
}
