//! The texts that users see: help and errors, as the program prints them.

use std::path::Path;

use crate::support::{Run, in_folder};

fn deepfusion(args: &[&str]) -> Run {
    in_folder(Path::new("."), args)
}

#[test]
fn help_texts() {
    for command in [
        "",
        "demo",
        "simulate",
        "data",
        "data inspect",
        "data export-gt",
        "doctor",
        "calibrate",
        "train",
        "adapt",
        "ablate",
        "compare",
        "config",
        "config show",
        "eval",
        "eval-odometry",
        "predict",
        "view",
        "export",
        "weights",
        "weights import",
        "weights pack",
        "weights average",
        "weights list",
        "bench",
        "completions",
    ] {
        let args: Vec<&str> = command.split_whitespace().chain(["--help"]).collect();
        let run = deepfusion(&args);
        assert_eq!((run.code, run.stderr.as_str()), (0, ""), "{command}");
        let name = format!("help {command}").trim().replace([' ', '-'], "_");
        insta::assert_snapshot!(name, run.stdout);
    }
}

/// The output of `config show` is a run's `config.toml`, and can be read as one.
#[test]
fn a_run_shows_its_configuration() {
    let folder = tempfile::tempdir().unwrap();
    let show = |args: &[&str]| in_folder(folder.path(), &[&["config", "show"], args].concat());
    let of_preset = show(&["light", "--set", "batch=7"]);
    std::fs::create_dir(folder.path().join("run")).unwrap();
    std::fs::write(folder.path().join("run/config.toml"), &of_preset.stdout).unwrap();
    let of_run = show(&["run"]);
    assert_eq!((of_run.code, &of_run.stdout), (0, &of_preset.stdout));
    let changed = show(&["run", "--set", "batch=8"]);
    assert!(changed.stdout.contains("batch = 8"), "{}", changed.stdout);
    let nothing = show(&["nowhere"]);
    assert_eq!(nothing.code, 2);
    assert!(nothing.stderr.contains("lite-mono"), "{}", nothing.stderr);
}

#[test]
fn alone_it_says_what_it_can_do() {
    let run = deepfusion(&[]);
    assert_eq!((run.code, run.stderr.as_str()), (0, ""));
    insta::assert_snapshot!(run.stdout);
}

#[test]
fn wrong_arguments_end_with_2_and_suggest_the_near_one() {
    for (args, expected) in [
        (&["traim"][..], "'train'"),
        (&["simulate", "--out", "x", "--scene", "urbna"], "'urban'"),
        (
            &["simulate", "--out", "x", "--size", "640"],
            "such as 640x192",
        ),
        (
            &[
                "eval",
                "--pred",
                "p.npz",
                "--pred-kind",
                "depht",
                "--gt",
                "g.npz",
            ],
            "'depth'",
        ),
        (&["eval", "--pred", "p.npz", "--gt", "g.npz"], "--pred-kind"),
        (&["eval", "--pred", "p.npz", "--pred-kind", "depth"], "--gt"),
        (&["eval"], "--data <PATH>"),
        (
            &[
                "eval",
                "--pred",
                "p",
                "--pred-kind",
                "depth",
                "--gt",
                "g",
                "--scale",
                "fixed=x",
            ],
            "fixed=5.4",
        ),
        (
            &[
                "eval",
                "--pred",
                "p",
                "--pred-kind",
                "depth",
                "--gt",
                "g",
                "--cap",
                "0",
            ],
            "above 0",
        ),
        (&["train", "--data", "d", "--without", "sped"], "'speed'"),
        (&["train", "--data", "d", "--preset", "tinny"], "'tiny'"),
        (&["train"], "--data <PATH>"),
        (
            &["data", "export-gt", "d", "--out", "x.npz", "--camera", "4"],
            "2, 3 or both",
        ),
        (
            &["data", "export-gt", "d", "--out", "x.txt"],
            "expected a name that ends in .npz",
        ),
        (
            &["data", "export-gt", "d", "--out", "x"],
            "expected a name that ends in .npz",
        ),
        (
            &["export", "--out", "m.txt"],
            "expected a name that ends in .onnx",
        ),
        (
            &[
                "predict",
                "--model",
                "m",
                "i.png",
                "--out",
                "o",
                "--intrinsics",
                "1,2,3",
            ],
            "fx,fy,cx,cy",
        ),
        (
            &["predict", "i.png", "--out", "o", "--max-depth", "-1"],
            "above 0",
        ),
        (&["simulate", "--out", "x", "--stereo", "-1"], "above 0"),
        (
            &["simulate", "--out", "x", "--camera-height", "-1.5"],
            "above 0",
        ),
        (&["calibrate", "b.mp4", "--board", "9"], "such as 9x6"),
        (&["data", "inspect", "d", "--hfov", "180"], "below 170"),
        (
            &[
                "eval",
                "--data",
                "d",
                "--hfov",
                "60",
                "--intrinsics",
                "1,2,3,4",
            ],
            "cannot be used with",
        ),
        (
            &[
                "predict", "--model", "m", "i.png", "--out", "o", "--save", "plyy",
            ],
            "'ply'",
        ),
        (
            &[
                "predict", "--model", "m", "i.png", "--out", "o", "--shard", "0/4",
            ],
            "the first of 4 is 1/4",
        ),
        (
            &[
                "predict", "--model", "m", "i.png", "--out", "o", "--shard", "5/4",
            ],
            "no shard 5 of 4",
        ),
    ] {
        let run = deepfusion(args);
        assert_eq!(run.code, 2, "{args:?}: {}", run.stderr);
        assert!(run.stderr.contains(expected), "{args:?}: {}", run.stderr);
        assert_eq!(run.stdout, "", "{args:?}");
    }
}

/// Shells complete every command, and the manual has a page for each.
#[test]
fn shells_and_the_manual_know_every_command() {
    let commands = ["train", "predict", "perceive", "eval-targets", "weights"];
    for shell in ["bash", "zsh", "fish", "elvish", "powershell"] {
        let run = deepfusion(&["completions", shell]);
        assert_eq!((run.code, run.stderr.as_str()), (0, ""), "{shell}");
        for command in commands {
            assert!(run.stdout.contains(command), "{shell}: {command}");
        }
    }
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().join("man1");
    let run = deepfusion(&["completions", "man", "--out", out.to_str().unwrap()]);
    assert_eq!((run.code, run.stderr.as_str()), (0, ""));
    let page = |name: &str| std::fs::read_to_string(out.join(name)).unwrap();
    for command in commands {
        assert!(page(&format!("deepfusion-{command}.1")).contains(".SH NAME"));
    }
    assert!(page("deepfusion-data-inspect.1").contains("overlay"));
    assert!(
        page("deepfusion.1").contains("metric depth")
            || page("deepfusion.1").contains("Metric depth")
    );
    let run = deepfusion(&["completions", "man"]);
    assert_eq!(run.code, 2, "{}", run.stderr);
}

#[test]
fn failures_say_what_where_and_what_to_do() {
    let folder = tempfile::tempdir().unwrap();
    std::fs::write(folder.path().join("text.npz"), "no archive").unwrap();
    std::fs::create_dir(folder.path().join("empty")).unwrap();
    std::fs::write(folder.path().join("taken.npz"), "").unwrap();
    let mut texts = String::new();
    for args in [
        "data inspect nowhere",
        "data inspect empty",
        "data inspect text.npz",
        "data export-gt empty --out taken.npz",
        "data export-gt nowhere --out gt.npz",
        "eval --pred nowhere.npz --pred-kind depth --gt text.npz",
        "eval --pred text.npz --pred-kind depth --gt text.npz",
        "view nowhere",
        "view empty",
        "view text.npz",
        "simulate --out . --frames 1",
        "simulate --out new --frames 0",
    ] {
        let run = in_folder(folder.path(), &args.split_whitespace().collect::<Vec<_>>());
        // A wrong value of an option ends with the code of wrong arguments.
        let code = if args.ends_with("--frames 0") { 2 } else { 1 };
        assert_eq!((run.code, run.stdout.as_str()), (code, ""), "{args}");
        assert!(
            run.stderr.contains("error: ") && run.stderr.contains("hint: "),
            "{args}: {}",
            run.stderr
        );
        texts += &format!("$ deepfusion {args}\n{}\n", run.stderr);
    }
    let left: Vec<_> = std::fs::read_dir(folder.path())
        .unwrap()
        .map(|e| e.unwrap().file_name())
        .collect();
    assert_eq!(left.len(), 3, "nothing half-written: {left:?}");
    insta::assert_snapshot!(texts);
}
