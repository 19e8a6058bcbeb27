//! Networks without a run folder: packed, embedded in the program, or missing.

use std::fs;
use std::path::Path;

use crate::support::{fails, json, ok, run};
use serde_json::Value;

/// A run, and its packed file in `predict`, `eval`, `export`, `bench` and `train`.
#[test]
fn a_packed_network_replaces_its_run() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    ok(
        at,
        "simulate --out sim --frames 12 --seed 3 --scan-every 4 --size 320x96",
    );
    ok(
        at,
        "train --data sim --size 96x64 --batch 2 --steps 2 --init none --out run",
    );
    let measured = json(at, "eval --model run --data sim --crop none --json");
    let pack = "weights pack --model run --name hut --simulated-only --recipe hut.toml";
    let card = json(at, &format!("{pack} --out packed --json"));
    ok(at, &format!("{pack} --out again"));
    for file in ["hut.safetensors", "hut.toml"] {
        let read = |folder: &str| fs::read(at.join(folder).join(file)).unwrap();
        assert_eq!(read("packed"), read("again"), "{file}");
    }
    // Half the size of the depth network alone, and no paths of where it was made.
    let bytes = fs::metadata(at.join("packed/hut.safetensors"))
        .unwrap()
        .len();
    assert_eq!(card["bytes"], bytes);
    let parameters = card["parameters"].as_u64().unwrap();
    assert!(bytes > 2 * parameters && bytes < 2 * parameters + parameters / 4);
    let text = fs::read_to_string(at.join("packed/hut.toml")).unwrap();
    assert!(!text.contains(at.to_str().unwrap()), "{text}");
    for (field, expected) in [
        ("name", Value::from("hut")),
        ("preset", "tiny".into()),
        ("size", serde_json::json!([96, 64])),
        ("checkpoint", measured["checkpoint"]["name"].clone()),
        ("steps", measured["checkpoint"]["step"].clone()),
        ("data", serde_json::json!(["sim"])),
        ("simulated_only", true.into()),
        ("recipe", "hut.toml".into()),
        ("default", false.into()),
    ] {
        assert_eq!(card[field], expected, "{field}");
    }
    let figure = &card["figures"][0];
    assert_eq!(figure["data"], "sim");
    let (kept, found) = (
        figure["abs_rel"].as_f64().unwrap(),
        measured["unscaled"]["abs_rel"].as_f64().unwrap(),
    );
    assert!((kept - found).abs() < 1e-9, "{kept} and {found}");
    assert!(card["depth_difference"].as_f64().unwrap() < 0.05, "{card}");
    fails(
        at,
        &format!("{pack} --out packed"),
        &["hut.toml", "already exists"],
    );
    ok(at, &format!("{pack} --out packed --overwrite"));

    let model = "--model packed/hut.safetensors";
    // Depth is the run's, except for the digits that bf16 loses.
    let again = json(at, &format!("eval {model} --data sim --crop none --json"));
    let abs_rel = |report: &Value| report["unscaled"]["abs_rel"].as_f64().unwrap();
    let (a, b) = (abs_rel(&measured), abs_rel(&again));
    assert!((a - b).abs() < 0.02 * a, "{a} and {b}");
    assert_eq!(again["checkpoint"]["name"], "hut");
    assert_eq!(again["checkpoint"]["sha256"], card["sha256"]);
    assert_eq!(again["checkpoint"]["step"], card["steps"]);
    let table = ok(at, &format!("eval {model} --data sim --crop none"));
    assert!(
        table.stdout.starts_with("network  hut, step "),
        "{}",
        table.stdout
    );
    assert!(table.stderr.contains("not saved"), "{}", table.stderr);
    let kept = fs::read_dir(at.join("packed")).unwrap().count();
    assert_eq!(kept, 2, "only the two files");
    fails(
        at,
        &format!("eval {model} --data sim --calibrate-confidence"),
        &["--calibrate-confidence", "hut"],
    );

    let image = "sim/2026_01_01/2026_01_01_drive_0003_sync/image_02/data/0000000000.png";
    let seen = |model: &str, out: &str| -> Value {
        json(
            at,
            &format!("predict {model} {image} --save npy --out {out} --json"),
        )[0]
        .clone()
    };
    let (of_run, of_file) = (seen("--model run", "a"), seen(model, "b"));
    assert_eq!(of_file["model"], "packed/hut.safetensors");
    assert_eq!(of_file["model_sha256"], card["sha256"]);
    assert!(of_run.get("model_sha256").is_none());
    assert_ne!(
        of_file["made_with"]["weights"],
        of_run["made_with"]["weights"]
    );
    // The training camera was packed, too: both assume it, and both are corrected by it.
    for field in [
        "intrinsics",
        "intrinsics_from",
        "camera_known",
        "focal_factor",
        "window",
    ] {
        assert_eq!(of_file[field], of_run[field], "{field}");
    }
    for end in 0..2 {
        let depth = |sidecar: &Value| sidecar["depth_m"][end].as_f64().unwrap();
        let (a, b) = (depth(&of_run), depth(&of_file));
        assert!((a - b).abs() < 0.05 * a, "{a} and {b}");
    }
    // The same command again finds everything done.
    let there = ok(at, &format!("predict {model} {image} --save npy --out b"));
    assert!(
        there.stderr.contains("1 existed already"),
        "{}",
        there.stderr
    );
    ok(
        at,
        &format!("predict {model} {image} --save features --out c"),
    );
    ok(at, &format!("perceive {model} {image} --out d"));

    let onnx = json(at, &format!("export {model} --out hut.onnx --json"));
    assert_eq!(onnx["size"], serde_json::json!([96, 64]));
    assert!(onnx["training_fy_px"].is_f64());
    // The embedded networks were trained on many cameras: depth is to be multiplied by each picture's own focal length.
    let onnx = json(
        at,
        "export --model tiny --size 96x64 --out tiny.onnx --json",
    );
    assert!(onnx["canonical_fy_px"].is_f64());
    assert_eq!(onnx["canonical_fy_px"], onnx["training_fy_px"]);
    let bench = json(at, &format!("bench {model} --repeats 1 --json"));
    assert_eq!(bench["network"], "packed/hut.safetensors");
    assert_eq!(bench["parameters"], parameters);
    fails(
        at,
        &format!("eval-odometry {model} --data sim"),
        &["hut", "no pose network"],
    );
    ok(at, &format!("eval-targets {model} --data sim --json"));
    // A packed network cannot be packed again.
    fails(
        at,
        "weights pack --model packed/hut.safetensors --name x --out y",
        &["already packed"],
    );
    fails(
        at,
        "weights pack --model run --name None --out y",
        &["None", "starts with a letter"],
    );

    starts_runs(at);

    let file = at.join("packed/hut.safetensors");
    let mut bytes = fs::read(&file).unwrap();
    *bytes.last_mut().unwrap() ^= 1;
    fs::write(&file, bytes).unwrap();
    for command in [
        format!("predict {model} {image} --out e"),
        format!("eval {model} --data sim"),
        "train --data sim --init packed/hut.safetensors --out e".to_owned(),
    ] {
        fails(at, &command, &["hut.safetensors", "SHA-256"]);
        assert!(!at.join("e").exists(), "{command}");
    }
}

/// Runs that start from `packed/hut.safetensors`.
fn starts_runs(at: &Path) {
    let train = "train --data sim --size 96x64 --batch 2 --steps 1";
    let started = ok(
        at,
        &format!("{train} --init packed/hut.safetensors --out tuned"),
    );
    assert!(
        started
            .stderr
            .contains("starts from packed/hut.safetensors; new: PoseNet"),
        "{}",
        started.stderr
    );
    let config = |run: &str| {
        let text = fs::read_to_string(at.join(run).join("config.toml")).unwrap();
        text.parse::<toml::Table>().unwrap()
    };
    let init = config("tuned")["init"].as_str().unwrap().to_owned();
    assert!(init.ends_with("packed/hut.safetensors") && Path::new(&init).is_absolute());
    assert!(!config("tuned").contains_key("init_sha256"));
    // Repeated from its own config.toml, it is the same run.
    ok(at, "train --config tuned/config.toml --out repeated");
    let last = |run: &str| {
        let read = deepfusion_nn::weights::read_safetensors_under;
        read(&at.join(run).join("last.safetensors"), "depth.").unwrap()
    };
    assert!(last("tuned").tensors == last("repeated").tensors);
    ok(
        at,
        "train --out tuned --resume --steps 2 --init packed/hut.safetensors",
    );
    fails(
        at,
        "train --out tuned --resume --steps 3 --init none",
        &["--init", "none", "hut.safetensors"],
    );
    // A different network cannot start from it, and the first tensor that differs is named.
    fails(
        at,
        &format!("{train} --preset light --init packed/hut.safetensors --out wide"),
        &["hut", "encoder."],
    );
    ok(at, &format!("{train} --init none --out anew"));
    assert!(!config("anew").contains_key("init"));
    assert!(last("anew").tensors != last("tuned").tensors);
}

/// A name that is neither a path nor embedded, and no name at all.
#[test]
fn a_missing_network_is_an_error_that_names_the_existing_ones() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    ok(
        at,
        "simulate --out sim --frames 6 --seed 3 --scan-every 2 --size 320x96",
    );
    let known: Vec<&str> = deepfusion_weights::names().collect();
    let embedded = match known.as_slice() {
        [] => "no embedded network",
        _ => "an embedded network: ",
    };
    for command in [
        "predict --model no-such-network sim --out out",
        "perceive --model no-such-network sim --out out",
        "eval --model no-such-network --data sim",
        "export --model no-such-network --out out.onnx",
        "bench --model no-such-network",
        "eval-targets --model no-such-network --data sim",
        "train --data sim --init no-such-network --out out",
    ] {
        fails(at, command, &["no-such-network", "folder", embedded]);
        assert!(!at.join("out").exists(), "{command}");
    }
    // An incomplete run is an error, even if its name is also an embedded network's.
    fs::create_dir(at.join("street")).unwrap();
    fs::write(at.join("street/last.safetensors"), "").unwrap();
    fails(
        at,
        "predict --model street sim --out out",
        &["street", "config.toml is missing"],
    );
    // A folder that is no run does not hide the network of its name.
    fs::rename(
        at.join("street/last.safetensors"),
        at.join("street/photo.png"),
    )
    .unwrap();
    if known.contains(&"street") {
        ok(at, "bench --model street --repeats 1");
        let train = "train --data sim --preset light --init street --batch 1 --steps 1";
        ok(at, &format!("{train} --size 64x64 --out begun"));
    }
    fs::remove_dir_all(at.join("street")).unwrap();

    if known.contains(&deepfusion_weights::DEFAULT) {
        return;
    }
    for command in [
        "predict sim --out out",
        "perceive sim --out out",
        "eval --data sim",
        "export --out out.onnx",
    ] {
        let run = run(at, command);
        assert_eq!(
            (run.code, run.stdout.as_str()),
            (2, ""),
            "{command}: {}",
            run.stderr
        );
        for part in ["--model", "hint: "] {
            assert!(run.stderr.contains(part), "{command}: {}", run.stderr);
        }
    }
    let bench = json(at, "bench --repeats 1 --json");
    assert_eq!(bench["network"], "tiny");
}

/// The networks that this build embeds, if any: listed, used by default, and the start of new runs with the same layers.
#[test]
fn embedded_networks_are_listed_and_used() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    let list = json(at, "weights list --json");
    let text = ok(at, "weights list").stdout;
    let names: Vec<&str> = list["embedded"]
        .as_array()
        .unwrap()
        .iter()
        .map(|network| network["name"].as_str().unwrap())
        .collect();
    assert_eq!(names, deepfusion_weights::names().collect::<Vec<_>>());
    assert_eq!(list["importable"].as_array().unwrap().len(), 6);
    assert_eq!(text.contains("none in this build"), names.is_empty());
    ok(
        at,
        "simulate --out sim --frames 6 --seed 3 --scan-every 2 --size 320x96",
    );
    let small = "train --data sim --size 96x64 --batch 1 --steps 1";
    let init = |run: &str, key: &str| {
        let config = fs::read_to_string(at.join(run).join("config.toml")).unwrap();
        let config: toml::Table = config.parse().unwrap();
        config.get(key).map(|v| v.as_str().unwrap().to_owned())
    };
    if names.is_empty() {
        let run = ok(at, &format!("{small} --out plain"));
        assert!(!run.stderr.contains("starts from"), "{}", run.stderr);
        assert_eq!(init("plain", "init"), None);
    }
    for network in list["embedded"].as_array().unwrap() {
        let name = network["name"].as_str().unwrap();
        let sha256 = network["sha256"].as_str().unwrap();
        assert!(text.contains(sha256), "{text}");
        let preset = network["preset"].as_str().unwrap();
        let expected_line = format!("starts from the embedded network `{name}`");
        let run = ok(at, &format!("{small} --preset {preset} --out from-{name}"));
        assert!(run.stderr.contains(&expected_line), "{}", run.stderr);
        let from = format!("from-{name}");
        assert_eq!(init(&from, "init").as_deref(), Some(name));
        assert_eq!(init(&from, "init_sha256").as_deref(), Some(sha256));
        ok(
            at,
            &format!("train --out {from} --resume --steps 2 --init {name}"),
        );
        let sidecars = json(
            at,
            &format!("predict --model {name} sim --out of-{name} --json"),
        );
        assert_eq!(sidecars[0]["model"], name);
        assert_eq!(sidecars[0]["model_sha256"], sha256);
    }
    if names.contains(&deepfusion_weights::DEFAULT) {
        let run = ok(at, "predict sim --out unasked");
        assert!(
            run.stderr
                .contains("no --model given: using the embedded network"),
            "{}",
            run.stderr
        );
        ok(at, "eval --data sim --crop none");
        ok(at, "export --out unasked.onnx");
        let lines = ok(at, "perceive sim --out targets --json").stdout;
        assert_eq!(lines.lines().count(), 6, "{lines}");
        for line in lines.lines() {
            let frame: Value = serde_json::from_str(line).unwrap();
            assert!(frame["targets"].is_array(), "{frame}");
        }
        let bench = json(at, "bench --repeats 1 --json");
        assert_eq!(bench["network"], deepfusion_weights::DEFAULT);
    }
}
