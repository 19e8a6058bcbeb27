//! Training, evaluation and prediction through the program, on good and bad input.

use std::fs;

use crate::support::{fails, ok, run};
use burn::tensor::Device;
use deepfusion_nn::weights;
use deepfusion_nn::{ResNet, ResNetConfig, ResNetDepth, WeightRng};
use serde_json::Value;

const SMALL: &str = "--size 96x64 --batch 2 --init none";

#[test]
fn a_drive_is_trained_on_resumed_evaluated_and_predicted() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    ok(at, "simulate --out sim --frames 12 --seed 3 --scan-every 4");
    ok(at, &format!("train --data sim {SMALL} --steps 2 --out run"));
    for file in [
        "config.toml",
        "log.csv",
        "last.safetensors",
        "best.safetensors",
    ] {
        assert!(at.join("run").join(file).is_file(), "{file}");
    }
    assert_eq!(fs::read_dir(at.join("run/panels")).unwrap().count(), 1);

    // A run can be continued with more steps; an existing one is not overwritten.
    ok(at, "train --out run --resume --steps 3");
    let log = fs::read_to_string(at.join("run/log.csv")).unwrap();
    let steps: Vec<_> = log
        .lines()
        .filter(|l| l.contains(",train,"))
        .map(|l| &l[..1])
        .collect();
    assert_eq!(steps, ["1", "2", "3"]);
    // It cannot become shorter than it is, and keeps its settings.
    fails(
        at,
        "train --out run --resume --steps 2",
        &["already made 3 steps", "more than 3 steps"],
    );
    let config = fs::read_to_string(at.join("run/config.toml")).unwrap();
    assert!(config.contains("\nsteps = 3\n"), "{config}");
    fails(
        at,
        &format!("train --data sim {SMALL} --steps 1 --out run"),
        &["run"],
    );

    // A new run may start from another's networks; its PoseNet keeps that one's unit. Parts that that one does
    // not have are printed.
    let tuned = ok(
        at,
        "train --data sim --size 96x64 --batch 2 --steps 1 --with flow --init run --out tuned",
    );
    let line = "starts from run/best.safetensors; new: the flow decoder";
    assert!(tuned.stderr.contains(line), "{}", tuned.stderr);
    let unit = |run: &str| {
        let config = fs::read_to_string(at.join(run).join("config.toml")).unwrap();
        // Measured values follow the settings.
        let line = config.lines().rfind(|l| l.starts_with("metres_per_unit"));
        line.unwrap().to_owned()
    };
    assert_eq!(unit("tuned"), unit("run"));

    let report: Value =
        serde_json::from_str(&ok(at, "eval --model run --data sim --json").stdout).unwrap();
    assert_eq!(report["n"], 3);
    assert_eq!(report["protocol"]["crop"], "garg");
    let abs_rel = report["unscaled"]["abs_rel"].as_f64().unwrap();
    assert!(abs_rel > 0.01 && abs_rel < 3.0, "{abs_rel}");
    assert!(report["scale"]["median"].as_f64().unwrap() > 0.2);
    assert!(report["trivial"]["unscaled"]["abs_rel"].is_number());
    // The run's checkpoint that was evaluated: the last that was validated, at the third step or before.
    assert_eq!(report["checkpoint"]["name"], "best");
    assert_eq!(report["checkpoint"]["path"], "run/best.safetensors");
    let step = report["checkpoint"]["step"].as_u64().unwrap();
    assert!(log.contains(&format!("\n{step},validation,")), "{log}");
    let text = ok(at, "eval --model run --data sim").stdout;
    let first = format!("checkpoint  run/best.safetensors, step {step} (the lowest held-out loss");
    assert!(text.starts_with(&first), "{text}");
    let text = ok(at, "eval --model run/last.safetensors --data sim").stdout;
    assert!(
        text.starts_with("checkpoint  run/last.safetensors, step 3\n"),
        "{text}"
    );

    let image = "sim/2026_01_01/2026_01_01_drive_0003_sync/image_02/data/0000000001.png";
    let all = "depth-png,npy,color,side-by-side,ply";
    ok(
        at,
        &format!("predict --model run {image} --calib sim/2026_01_01 --save {all} --out depth"),
    );
    let sidecar = fs::read_to_string(at.join("depth/0000000001.json")).unwrap();
    let sidecar: Value = serde_json::from_str(&sidecar).unwrap();
    assert_eq!(sidecar["files"].as_array().unwrap().len(), 5);
    assert_eq!(sidecar["camera_known"], true);
    // Evaluated on training data only, which proves nothing about the scale.
    let unknown = serde_json::json!({"bias": null, "ci95": null, "verdict": "open"});
    assert_eq!(sidecar["scale"], unknown);
    ok(
        at,
        "simulate --out other --frames 12 --seed 9 --scan-every 1",
    );
    let other: Value =
        serde_json::from_str(&ok(at, "eval --model run --data other --json").stdout).unwrap();
    ok(
        at,
        &format!("predict --model run {image} --calib sim/2026_01_01 --save npy --out measured"),
    );
    let measured = fs::read_to_string(at.join("measured/0000000001.json")).unwrap();
    let measured: Value = serde_json::from_str(&measured).unwrap();
    let near = |a: &Value, b: &Value| (a.as_f64().unwrap() - b.as_f64().unwrap()).abs() < 1e-9;
    let (recorded, found) = (&measured["scale"], &other["scale"]);
    assert!(
        near(&recorded["bias"], &found["bias"]),
        "{recorded} {found}"
    );
    for end in 0..2 {
        assert!(
            near(&recorded["ci95"][end], &found["bias_ci95"][end]),
            "{recorded} {found}"
        );
    }
    // After two steps the scale cannot be trusted, whatever it happens to be.
    assert_ne!(measured["scale"]["verdict"], "trusted");
    let seen: Vec<_> = fs::read_dir(at.join("run/eval"))
        .unwrap()
        .map(|entry| fs::read(entry.unwrap().path()).unwrap())
        .map(|text| serde_json::from_slice::<Value>(&text).unwrap())
        .map(|saved| saved["measured"]["held_out"].clone())
        .collect();
    // Evaluations of best on both drives, and of last.
    assert_eq!(seen.len(), 3);
    assert!(
        seen.contains(&Value::Bool(true)) && seen.contains(&Value::Bool(false)),
        "{seen:?}"
    );
    assert!((sidecar["focal_factor"].as_f64().unwrap() - 1.0).abs() < 1e-9);
    // With twice the focal length, the same picture is twice as far away.
    let k = "--intrinsics 743.6,738.9,313.9,88.3";
    ok(
        at,
        &format!("predict --model run {image} {k} --save npy --out zoomed"),
    );
    let zoomed = fs::read_to_string(at.join("zoomed/0000000001.json")).unwrap();
    let zoomed: Value = serde_json::from_str(&zoomed).unwrap();
    assert!((zoomed["focal_factor"].as_f64().unwrap() - 2.0).abs() < 1e-3);
    // Without a camera, the assumption is printed.
    let assumed = ok(
        at,
        &format!("predict --model run {image} --out assumed --json"),
    );
    assert!(assumed.stderr.contains("assumed"), "{}", assumed.stderr);
    assert!(
        assumed.stdout.contains("\"camera_known\": false"),
        "{}",
        assumed.stdout
    );

    // No file is overwritten, and wrong cameras are errors.
    fails(
        at,
        &format!("predict --model run {image} --out assumed --save npy"),
        &["0000000001"],
    );
    let wrong = "--intrinsics 743.6,738.9,5000,88.3";
    fails(
        at,
        &format!("predict --model run {image} {wrong} --out wrong"),
        &["cx"],
    );
    fails(
        at,
        "predict --model run nothing.png --out none",
        &["nothing.png"],
    );
    fails(at, "predict --model nowhere a.png --out none", &["nowhere"]);
    fs::write(
        at.join("cut.png"),
        &fs::read(at.join(image)).unwrap()[..900],
    )
    .unwrap();
    fails(at, "predict --model run cut.png --out none", &["cut.png"]);

    // A checkpoint of another architecture, and one cut off.
    let config = fs::read_to_string(at.join("run/config.toml")).unwrap();
    let wider = config.replacen("base_width = 32", "base_width = 24", 1);
    assert_ne!(config, wider);
    fs::write(at.join("run/config.toml"), wider).unwrap();
    fails(at, "eval --model run --data sim", &["encoder"]);
    fs::write(at.join("run/config.toml"), &config).unwrap();
    let weights = fs::read(at.join("run/last.safetensors")).unwrap();
    fs::write(
        at.join("run/last.safetensors"),
        &weights[..weights.len() / 2],
    )
    .unwrap();
    fails(
        at,
        "train --out run --resume --steps 4",
        &["last.safetensors"],
    );
    // A run that ended before its first checkpoint.
    fs::remove_file(at.join("run/last.safetensors")).unwrap();
    fails(
        at,
        "train --out run --resume",
        &["run: this run has no checkpoint yet", "without --resume"],
    );
}

/// Opening recordings may take long, so errors that do not need them come first: here there are no recordings.
#[test]
fn errors_of_start_or_folder_come_before_the_recordings_are_read() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    fs::create_dir(at.join("taken")).unwrap();
    fs::write(at.join("taken/file"), "x").unwrap();
    let train = "train --data no-drive";
    fails(at, &format!("{train} --init no-weights"), &["no-weights"]);
    let both = run(at, &format!("{train} --with hce --without affine,hce"));
    assert_eq!(both.code, 2, "{}", both.stderr);
    assert!(
        both.stderr.contains("--with hce and --without hce"),
        "{}",
        both.stderr
    );
    fails(
        at,
        &format!("{train} --out taken"),
        &["taken: already exists"],
    );
    fails(at, &format!("{train} --out new"), &["no-drive"]);
    assert!(!at.join("new").exists());
    assert!(!at.join("runs").exists());
}

/// Stopped as by a scheduler and by a closed terminal: saved, not reported as done, and continued.
#[test]
#[cfg(unix)]
fn a_stopped_run_is_saved_and_does_not_end_with_0() {
    use std::process::{Command, Stdio};

    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    ok(at, "simulate --out sim --frames 6 --seed 3 --scan-every 0");
    let steps = || {
        let log = fs::read_to_string(at.join("run/log.csv")).unwrap_or_default();
        log.lines().filter(|l| l.contains(",train,")).count()
    };
    let stopped = |args: &str, signal: &str, reader_stays: bool| {
        let before = steps();
        let mut child = Command::new(env!("CARGO_BIN_EXE_deepfusion"))
            .current_dir(at)
            .args(args.split_whitespace())
            .stdout(Stdio::piped())
            .stderr(Stdio::piped())
            .spawn()
            .unwrap();
        if !reader_stays {
            // The terminal is closed, so nothing more is printed.
            drop(child.stderr.take());
        }
        while steps() <= before && child.try_wait().unwrap().is_none() {
            std::thread::sleep(std::time::Duration::from_millis(1));
        }
        let pid = child.id().to_string();
        let sent = Command::new("kill").args([signal, &pid]).status().unwrap();
        assert!(sent.success());
        let output = child.wait_with_output().unwrap();
        let printed = String::from_utf8(output.stderr).unwrap();
        assert_eq!(output.status.code(), Some(130), "{signal}: {printed}");
        assert_eq!(output.stdout, b"", "{signal}");
        printed
    };
    let train = format!("train --data sim {SMALL} --steps 100000 --out run");
    let printed = stopped(&train, "-TERM", true);
    assert!(
        printed.contains("hint: continue with: deepfusion train --out run --resume"),
        "{printed}"
    );
    assert!(at.join("run/last.safetensors").is_file());
    if !hangups_are_ignored() {
        stopped("train --out run --resume", "-HUP", false);
    }
    let done = steps();
    ok(
        at,
        &format!("train --out run --resume --steps {}", done + 1),
    );
    assert_eq!(steps(), done + 1);
}

/// Whether these tests run under `nohup` or similar, whose ignored signals every program that they start inherits.
#[cfg(unix)]
fn hangups_are_ignored() -> bool {
    let status = fs::read_to_string("/proc/self/status").unwrap_or_default();
    let ignored = status.lines().find_map(|line| line.strip_prefix("SigIgn:"));
    // The lowest bit of the signal mask is SIGHUP's.
    ignored.is_some_and(|mask| u64::from_str_radix(mask.trim(), 16).is_ok_and(|mask| mask & 1 == 1))
}

/// `nohup` must keep working after the terminal closes.
#[test]
#[cfg(unix)]
fn a_hangup_that_was_ignored_stays_ignored() {
    use std::process::{Command, Stdio};

    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    ok(at, "simulate --out sim --frames 6 --seed 3 --scan-every 0");
    let train = format!("train --data sim {SMALL} --steps 12 --out run");
    let mut child = Command::new("sh")
        .current_dir(at)
        .args(["-c", "trap '' HUP; exec \"$0\" \"$@\""])
        .arg(env!("CARGO_BIN_EXE_deepfusion"))
        .args(train.split_whitespace())
        .stdout(Stdio::null())
        .stderr(Stdio::null())
        .spawn()
        .unwrap();
    let begun = || fs::read_to_string(at.join("run/log.csv")).is_ok_and(|l| l.contains(",train,"));
    while !begun() && child.try_wait().unwrap().is_none() {
        std::thread::sleep(std::time::Duration::from_millis(1));
    }
    let pid = child.id().to_string();
    assert!(
        Command::new("kill")
            .args(["-HUP", &pid])
            .status()
            .unwrap()
            .success()
    );
    assert!(child.wait().unwrap().success());
}

#[test]
fn a_run_is_continued_from_any_folder_and_with_moved_data() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    let elsewhere = at.join("elsewhere");
    fs::create_dir(&elsewhere).unwrap();
    ok(at, "simulate --out sim --frames 6 --seed 3 --scan-every 0");
    ok(at, "simulate --out val --frames 6 --seed 4 --scan-every 0");
    ok(
        at,
        &format!("train --data sim --val-data val {SMALL} --steps 1 --out run"),
    );
    ok(&elsewhere, "train --out ../run --resume --steps 2");

    fs::rename(at.join("sim"), at.join("moved")).unwrap();
    let sim = at.join("sim").display().to_string();
    fails(
        &elsewhere,
        "train --out ../run --resume --steps 3",
        &[&sim, "--data"],
    );
    ok(
        &elsewhere,
        "train --out ../run --resume --steps 3 --data ../moved",
    );
    fs::rename(at.join("val"), at.join("val2")).unwrap();
    fails(
        at,
        "train --out run --resume --steps 4",
        &["/val:", "--val-data"],
    );
    ok(at, "train --out run --resume --steps 4 --val-data val2");
    ok(&elsewhere, "train --out ../run --resume --steps 5");
    // Options that contradict the run are refused.
    fails(
        at,
        "train --out run --resume --steps 6 --batch 4",
        &["`--batch`: 4 contradicts the run, which has 2"],
    );
}

/// The recordings of a configuration file, and each option that replaces a part of them.
#[test]
fn options_replace_their_own_part_of_a_file() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    ok(at, "simulate --out sim --frames 6 --seed 3 --scan-every 0");
    ok(at, "simulate --out val --frames 6 --seed 4 --scan-every 0");
    ok(at, "simulate --out more --frames 6 --seed 5 --scan-every 0");
    ok(
        at,
        &format!("train --data sim {SMALL} --steps 1 --out first"),
    );
    let data = |run: &str| {
        let text = fs::read_to_string(at.join(run).join("config.toml")).unwrap();
        text.parse::<toml::Table>().unwrap()["data"].clone()
    };
    let path = |name: &str| toml::Value::from(at.join(name).display().to_string());
    // Without --data: the file's recordings, validated on those of the option.
    let second = ok(
        at,
        "train --config first/config.toml --val-data val --out second",
    );
    // A file without `init` starts from random weights, which is printed if an embedded network would fit.
    let fits = deepfusion_weights::names().any(|name| name == "tiny");
    let is_printed = second
        .stderr
        .contains("starts from random weights, as the configuration has no `init` (--init tiny");
    assert_eq!(is_printed, fits, "{}", second.stderr);
    assert_eq!(data("second")["paths"][0], path("sim"));
    assert_eq!(data("second")["validation"][0], path("val"));
    // With --data: other recordings, and the file's validation.
    let third = ok(
        at,
        "train --config second/config.toml --data more --init none --out third",
    );
    assert!(
        !third.stderr.contains("starts from random weights"),
        "{}",
        third.stderr
    );
    assert_eq!(data("third")["paths"][0], path("more"));
    assert_eq!(data("third")["validation"][0], path("val"));
    // A split and a camera that the file's recordings do not have are errors, not left out.
    fs::write(at.join("split.txt"), "nowhere/nothing 1 l\n").unwrap();
    fails(
        at,
        "train --config first/config.toml --split split.txt --out fourth",
        &["split.txt"],
    );
    fails(
        at,
        "train --config first/config.toml --camera 3 --out fifth",
        &["camera 3"],
    );
    // Recordings beside those of a file's data sets.
    let config = fs::read_to_string(at.join("first/config.toml")).unwrap();
    let mut table: toml::Table = config.parse().unwrap();
    table["data"] = toml::Value::Table(
        "sets = [{ name = 'road', paths = ['sim'] }]"
            .parse()
            .unwrap(),
    );
    fs::write(at.join("sets.toml"), table.to_string()).unwrap();
    for option in ["--data more", "--val-data val", "--split split.txt"] {
        let name = option.split(' ').next().unwrap();
        let args = format!("train --config sets.toml {option} --out sixth");
        let run = run(at, &args);
        assert_eq!(run.code, 1, "{}", run.stderr);
        assert!(
            run.stderr.contains(name) && run.stderr.contains("[[data.sets]]"),
            "{}",
            run.stderr
        );
    }
}

#[test]
fn unusable_data_or_settings_are_errors() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    fails(at, "train --data nowhere", &["nowhere"]);
    fs::create_dir(at.join("empty")).unwrap();
    fails(at, "train --data empty", &["empty"]);
    // Contradictory options are not silently resolved.
    let contradiction = run(
        at,
        "train --data empty --without speed --view-motion vehicle",
    );
    assert_eq!(contradiction.code, 1, "{}", contradiction.stderr);
    for part in ["`view_motion`", "posenet if loss.speed is 0", "vehicle"] {
        let named = contradiction.stderr.contains(part);
        assert!(named, "{part}: {}", contradiction.stderr);
    }

    ok(at, "simulate --out sim --frames 6 --seed 3 --scan-every 0");
    let drive = at.join("sim/2026_01_01/2026_01_01_drive_0003_sync");
    let packet = drive.join("oxts/data/0000000002.txt");
    let good = fs::read_to_string(&packet).unwrap();
    let mut fields: Vec<_> = good.split_whitespace().collect();
    fields[8] = "nan";
    fs::write(&packet, fields.join(" ")).unwrap();
    fails(at, "train --data sim", &["0000000002.txt", "vf"]);
    fs::write(&packet, &good).unwrap();

    let stamps = drive.join("image_02/timestamps.txt");
    fs::rename(&stamps, at.join("stamps")).unwrap();
    fails(at, "train --data sim", &["timestamps.txt"]);
    fs::rename(at.join("stamps"), &stamps).unwrap();

    // A learning rate that destroys the weights: the error names the loss with its frames, and the run can be
    // inspected.
    ok(
        at,
        &format!("train --data sim {SMALL} --steps 1 --out seed"),
    );
    let config = fs::read_to_string(at.join("seed/config.toml")).unwrap();
    let broken: String = config
        .lines()
        .map(|l| {
            let is_rate = l.starts_with("learning_rate = ");
            let steps = l.starts_with("steps = ");
            match (is_rate, steps) {
                (true, _) => "learning_rate = 1e30\n".to_owned(),
                (_, true) => "steps = 30\n".to_owned(),
                _ => format!("{l}\n"),
            }
        })
        .collect();
    fs::write(at.join("broken.toml"), broken).unwrap();
    fails(
        at,
        "train --data sim --config broken.toml --out broken",
        &["loss term", "2026_01_01_drive_0003_sync/"],
    );

    // A car that stands still gives no parallax to learn from.
    for entry in fs::read_dir(drive.join("oxts/data")).unwrap() {
        let path = entry.unwrap().path();
        let text = fs::read_to_string(&path).unwrap();
        let mut fields: Vec<_> = text.split_whitespace().collect();
        for field in 8..11 {
            fields[field] = "0.0";
        }
        fs::write(&path, fields.join(" ")).unwrap();
    }
    fails(at, "train --data sim", &["m/s"]);
}

/// Two processes would overwrite each other's log and checkpoints.
#[cfg(unix)]
#[test]
fn a_run_is_continued_by_one_process_at_a_time() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    ok(at, "simulate --out sim --frames 6 --seed 3 --scan-every 0");
    ok(
        at,
        "train --data sim --size 96x64 --batch 1 --steps 1 --init none --out run",
    );
    let kept = fs::read(at.join("run/config.toml")).unwrap();
    let at_work = deepfusion_fs::FolderLock::take(&at.join("run")).unwrap();
    let resume = "train --out run --resume --steps 2";
    fails(at, resume, &["run", "another process is already writing"]);
    assert_eq!(fs::read(at.join("run/config.toml")).unwrap(), kept);
    drop(at_work);
    ok(at, resume);
}

/// Imported encoders start a network whose other parts the import does not have. PoseNet's unit comes from the new data: the
/// import has no metric scale.
#[test]
fn imported_encoders_start_a_preset_with_other_parts() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    let mut rng = WeightRng::new(5);
    let config = ResNetConfig::new(ResNetDepth::ResNet18);
    let resnet = ResNet::new(&config, &mut rng, &Device::flex());
    let resnet = weights::collect(&resnet.unwrap());
    weights::write_safetensors(&at.join("resnet18.safetensors"), &resnet).unwrap();
    ok(at, "weights import resnet18.safetensors --out imported");
    ok(at, "simulate --out sim --frames 6 --seed 3 --scan-every 0");
    let start = "train --data sim --preset light --size 96x64 --batch 1 --steps 1";
    let parts = "--with hce,attention,aggregation";
    let run = ok(at, &format!("{start} {parts} --init imported --out run"));
    let line = "starts from imported/last.safetensors; new: everything but the encoders";
    assert!(run.stderr.contains(line), "{}", run.stderr);
    let config = fs::read_to_string(at.join("run/config.toml")).unwrap();
    assert!(!config.contains("metres_per_unit = 1.0"), "{config}");
}

/// Monodepth2's preset has tensors of the embedded network's shapes, but another normalisation of images and another depth range.
#[test]
fn weights_trained_with_other_conventions_give_a_warning() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    ok(at, "simulate --out sim --frames 6 --seed 3 --scan-every 0");
    let start =
        "train --data sim --preset monodepth2 --init street --size 96x64 --batch 1 --steps 1";
    let run = ok(at, &format!("{start} --out as-the-preset"));
    let warned = ["normalised as imagenet", "depths of 0.1 to 90 m"];
    for words in warned {
        assert!(run.stderr.contains(words), "{words}: {}", run.stderr);
    }
    let kept = "--set depth_net.encoder.normalisation=imagenet --set depth_net.range.max_m=90";
    let run = ok(at, &format!("{start} {kept} --out as-the-network"));
    for words in warned {
        assert!(!run.stderr.contains(words), "{words}: {}", run.stderr);
    }
}

#[test]
fn weights_are_listed_and_a_network_is_timed() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    assert!(ok(at, "weights list").stdout.contains("Monodepth2"));
    fails(at, "weights import missing.pth --out run", &["missing.pth"]);
    let bench = ok(at, "bench --preset tiny --size 96x64 --repeats 1 --json");
    let bench: Value = serde_json::from_str(&bench.stdout).unwrap();
    for stage in ["decode", "resize", "network", "depth", "cloud", "colour"] {
        assert!(bench["stages_ms"][stage].as_f64().unwrap() > 0.0, "{stage}");
    }
    assert!(bench["fps"].as_f64().unwrap() > 0.0);
    assert!(
        bench["latency_ms"].as_f64().unwrap() > bench["stages_ms"]["network"].as_f64().unwrap()
    );
    assert!(bench["peak_device_mb"].is_null());
    assert!(bench["parameters"].as_u64().unwrap() > 100_000);
    let modules = bench["modules"].as_array().unwrap();
    let (pose, depth) = modules.split_last().unwrap();
    assert_eq!(pose["name"], "pose_net");
    for total in ["parameters", "multiply_adds"] {
        let parts = depth.iter().map(|m| m[total].as_u64().unwrap());
        assert_eq!(bench[total].as_u64().unwrap(), parts.sum::<u64>());
    }
    #[cfg(target_os = "linux")]
    assert!(bench["peak_rss_mb"].as_f64().unwrap() > 1.0);
}

/// Two cameras are trained with each other's views, without speeds; one camera is refused.
#[test]
fn each_of_two_cameras_is_a_view_of_the_other() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    let street = "simulate --frames 8 --seed 3 --scan-every 0 --size 192x64";
    ok(at, &format!("{street} --stereo 0.5 --out two"));
    ok(at, &format!("{street} --out one"));
    let train = "train --preset tiny --size 96x64 --batch 2 --steps 2 --init none --stereo";
    ok(
        at,
        &format!("{train} --data two --without speed --view-motion posenet --out run"),
    );
    let config = fs::read_to_string(at.join("run/config.toml")).unwrap();
    for line in [
        "stereo = true",
        "reprojection = \"minimum\"",
        "camera = \"both\"",
    ] {
        assert!(config.contains(line), "{line}: {config}");
    }
    ok(at, "train --out run --resume --steps 3 --stereo");
    let refused = format!("{train} --data one --out other");
    fails(at, &refused, &["second camera", "image_03"]);
    let bag = run(
        at,
        "simulate --format bag --stereo 0.5 --frames 2 --out bag",
    );
    assert_eq!(bag.code, 2, "{}", bag.stderr);
    for part in ["--stereo", "one camera", "hint: "] {
        assert!(bag.stderr.contains(part), "{part}: {}", bag.stderr);
    }
    assert!(!at.join("bag").exists());
}

#[test]
fn both_cameras_of_a_drive_with_one_give_a_warning() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    let street = "simulate --frames 8 --seed 3 --scan-every 4 --size 192x64";
    ok(at, &format!("{street} --out one"));
    ok(at, &format!("{street} --stereo 0.5 --out two"));
    let train = "train --size 96x64 --batch 2 --steps 1 --init none";
    for (command, warnings) in [
        (format!("{train} --data one --camera both --out run"), 1),
        ("data export-gt one --camera both --out a.npz".into(), 1),
        ("data export-gt one --out b.npz".into(), 0),
        ("data export-gt two --camera both --out c.npz".into(), 0),
    ] {
        let printed = ok(at, &command).stderr;
        let warning = "both cameras are asked for, but only camera 2 has images";
        assert_eq!(
            printed.matches(warning).count(),
            warnings,
            "{command}: {printed}"
        );
    }
}
