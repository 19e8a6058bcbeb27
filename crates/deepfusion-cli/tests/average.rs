//! `weights average`: one network from several.

use std::fs;
use std::path::Path;

use crate::support::{fails, json, ok, run};
use serde_json::Value;

/// Whether training saw the drive, according to the run's saved evaluation.
fn held_out(at: &Path, model: &str, drive: &str) -> Value {
    let kept = at.join(model).join("eval");
    let _ = fs::remove_dir_all(&kept);
    let eval = format!("eval --model {model} --data {drive} --crop none --no-verdict");
    ok(at, &eval);
    let file = fs::read_dir(kept).unwrap().next().unwrap().unwrap();
    let saved: Value = serde_json::from_slice(&fs::read(file.path()).unwrap()).unwrap();
    saved["measured"]["held_out"].clone()
}

#[test]
fn a_mean_of_runs_counts_as_trained_on_all_their_drives() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    for (name, seed) in [("first", 3), ("second", 4), ("third", 5)] {
        ok(
            at,
            &format!("simulate --out {name} --frames 8 --seed {seed} --scan-every 4 --size 320x96"),
        );
    }
    let train = "train --size 96x64 --batch 2 --steps 2 --set validation_share=0";
    ok(at, &format!("{train} --data first --init none --out a"));
    ok(at, &format!("{train} --data second --init a --out b"));
    let made = ok(at, "weights average a b --out mean");
    assert!(made.stdout.starts_with("mean"), "{}", made.stdout);
    assert!(made.stderr.contains("0.500 of "), "{}", made.stderr);
    // One was trained from the other; their batch norms have different statistics.
    let warned: Vec<&str> = made.stderr.lines().filter(|l| l.contains("WARN")).collect();
    assert_eq!(warned.len(), 1, "{}", made.stderr);
    assert!(warned[0].contains("batch norms differ"), "{}", made.stderr);
    // The settings are those of `a`, which was trained only on the first drive.
    assert_eq!(held_out(at, "a", "second"), true);
    for (drive, unseen) in [("first", false), ("second", false), ("third", true)] {
        assert_eq!(held_out(at, "mean", drive), unseen, "{drive}");
    }
    let card = json(
        at,
        "weights pack --model mean --name hut --out packed --json",
    );
    assert_eq!(card["data"], serde_json::json!(["first", "second"]));
    fails(at, "train --out mean --resume", &["optimiser"]);

    // A run started from these settings is not a mean, and can be continued.
    let from = format!("{train} --config mean/config.toml --data third");
    let went_on = ok(at, &format!("{from} --init mean --out on"));
    assert!(
        !went_on.stderr.contains("mean of 2 networks"),
        "{}",
        went_on.stderr
    );
    // Otherwise it would repeat the first network's run.
    fails(
        at,
        "train --config mean/config.toml --data nowhere --out off",
        &["WARN", "mean of 2 networks", "--init mean ", "nowhere"],
    );
    // Elsewhere its folder is unknown, and an `init` that was given is intended.
    let settings = fs::read_to_string(at.join("mean/config.toml")).unwrap();
    let chosen = format!("init = \"b\"\n{settings}");
    for (text, warns) in [(settings, true), (chosen, false)] {
        fs::write(at.join("copy.toml"), text).unwrap();
        let off = run(at, "train --config copy.toml --data nowhere --out off");
        assert!(off.stderr.contains("nowhere"), "{}", off.stderr);
        let is_warned = off.stderr.contains("mean of 2 networks");
        assert_eq!(is_warned, warns, "{}", off.stderr);
        let mut warnings = off.stderr.lines().filter(|line| line.contains("WARN"));
        assert!(
            warnings.all(|line| !line.contains("--init")),
            "{}",
            off.stderr
        );
    }
    let on = fs::read_to_string(at.join("on/config.toml")).unwrap();
    assert!(!on.contains("averaged"), "{on}");
    assert_eq!(
        held_out(at, "on", "second"),
        false,
        "because of the network it started from"
    );

    // A packed network can be averaged, as an embedded one can.
    let third = json(
        at,
        "weights average a packed/hut.safetensors --shares 3,1 --out c --json",
    );
    let shares: Vec<&Value> = (0..2).map(|i| &third["networks"][i]["share"]).collect();
    assert_eq!(shares, [0.75, 0.25]);
    let differ = |key: &str| third["statistics"][key].as_u64().unwrap();
    assert!(0 < differ("layers") && differ("layers") <= differ("of"));
    let left_out = &third["statistics"]["left_out"];
    assert!(left_out.as_f64().unwrap() > 0.0, "{left_out}");
    // Of its training data only the kind is known.
    assert_eq!(held_out(at, "c", "third"), Value::Null);

    fails(
        at,
        "weights average a b --shares 1 --out no",
        &["1 share for 2 networks", "hint:"],
    );
    fails(
        at,
        "weights average a street --out no",
        &["street: its layers differ", "hint:"],
    );
    fails(
        at,
        "weights average street a --out no",
        &["street", "expected a run"],
    );
    fails(
        at,
        "weights average a b --out mean",
        &["mean: the output folder is not empty"],
    );
    ok(
        at,
        &format!("{train} --data first --init none --seed 9 --out strange"),
    );
    let strangers = ok(at, "weights average a strange --out strangers");
    assert!(strangers.stderr.contains("WARN"), "{}", strangers.stderr);

    hides_the_embedded_network(at);

    // A mean was trained on its networks' data: simulated drives, one that nothing shows to be simulated, one named like a day of
    // KITTI's, and one that no longer exists.
    let pack = "weights pack --model mean --name blind --simulated-only --out blind --overwrite";
    assert!(!ok(at, pack).stderr.contains("WARN"));
    let is_unsure = || {
        let unsure = ok(at, pack).stderr;
        let about = unsure.contains("WARN") && unsure.contains("second");
        assert!(about, "{unsure}");
    };
    let date = at.join("second/2026_01_01");
    let drive = date.join("2026_01_01_drive_0004_sync");
    fs::remove_file(drive.join("poses.txt")).unwrap();
    is_unsure();
    fs::rename(&drive, date.join("2011_09_26_drive_0004_sync")).unwrap();
    let refused = ["second", "which is real", "KITTI raw", "--simulated-only"];
    fails(at, pack, &refused);
    fs::rename(at.join("second"), at.join("elsewhere")).unwrap();
    is_unsure();
}

/// A run with an embedded network's name is used instead of it, with a warning.
fn hides_the_embedded_network(at: &Path) {
    let Some(name) = deepfusion_weights::names().next() else {
        return;
    };
    ok(at, &format!("weights average a b --out {name}"));
    let bench = |model: &str| ok(at, &format!("bench --model {model} --repeats 1")).stderr;
    let train = format!(
        "train --data third --size 96x64 --batch 2 --steps 1 --init {name} --out from-{name}"
    );
    let average = format!("weights average a {name} --out again");
    for printed in [bench(name), ok(at, &train).stderr, ok(at, &average).stderr] {
        let about = printed.lines().filter(|line| line.contains("WARN"));
        let about: Vec<&str> = about.filter(|line| line.contains("embedded")).collect();
        assert_eq!(about.len(), 1, "{printed}");
        assert!(about[0].contains(&format!("./{name}")), "{printed}");
    }
    for path in [format!("./{name}"), format!("{name}/")] {
        assert!(!bench(&path).contains("WARN"), "{path}");
    }
}
