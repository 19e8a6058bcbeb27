//! A run's report, its saved evaluations and their comparison, through the program.

use std::fs;
use std::path::Path;

use crate::support::{self, fails, run};
use serde_json::Value;

/// Output of a command that must succeed.
fn ok(folder: &Path, args: &str) -> String {
    support::ok(folder, args).stdout
}

fn page(path: &Path) -> String {
    let html = fs::read_to_string(path).unwrap();
    for outside in ["http://", "https://", "@import", "<script", "<link"] {
        assert!(!html.contains(outside), "{outside}");
    }
    assert!(html.starts_with("<!doctype html>") && html.ends_with("</html>\n"));
    html
}

fn kept(run: &Path) -> Vec<Value> {
    let files = fs::read_dir(run.join("eval")).unwrap();
    let read = |f: fs::DirEntry| serde_json::from_slice(&fs::read(f.path()).unwrap()).unwrap();
    files.map(|f| read(f.unwrap())).collect()
}

#[test]
fn runs_are_reported_kept_and_compared() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    ok(
        at,
        "simulate --out sim --frames 24 --seed 3 --scan-every 4 --size 320x96",
    );
    for (name, steps) in [("a", 2), ("b", 3)] {
        ok(
            at,
            &format!(
                "train --data sim --size 96x64 --batch 2 --steps {steps} --init none --out {name}"
            ),
        );
    }

    // The points in space, and the page.
    let printed = ok(
        at,
        "eval --model a --data sim --points 500 --points-seed 9 --report a.html --json",
    );
    let report: Value = serde_json::from_str(&printed).unwrap();
    let points = &report["points"];
    assert_eq!((&points["n"], &points["seed"]), (&500.into(), &9.into()));
    assert_eq!(points["in_space"], true);
    for field in ["mean_m", "std_m", "sem_m", "sem_images_m"] {
        assert!(points[field].as_f64().unwrap() > 0.0, "{points}");
    }
    let in_ranges: u64 = points["ranges"]
        .as_array()
        .unwrap()
        .iter()
        .map(|r| r["n"].as_u64().unwrap())
        .sum();
    assert_eq!(in_ranges, 500);
    let html = page(&at.join("a.html"));
    for part in [
        "Accuracy",
        "Points in space",
        "Best and worst frames",
        "Learning curves",
        "config.toml",
        "SHA-256",
    ] {
        assert!(html.contains(part), "{part}");
    }
    // Six images were evaluated: the two best, the median and the two worst with four pictures each, and four pictures of clouds.
    assert_eq!(report["n"], 6);
    assert_eq!(html.matches("data:image/jpeg").count(), 5 * 4 + 4);

    // The saved metrics are those printed for the ground truth; the verdict is not compared.
    let saved = kept(&at.join("a"));
    assert_eq!(saved.len(), 1);
    let mut measured = report.clone();
    let checkpoint = measured.as_object_mut().unwrap().remove("checkpoint");
    assert_eq!(checkpoint.unwrap()["name"], "best");
    let verdict = ["scale_certificate", "no_certificate", "without_truth"];
    for key in verdict {
        measured.as_object_mut().unwrap().remove(key);
    }
    assert_eq!(saved[0]["report"], measured);
    assert_eq!(saved[0]["images"].as_array().unwrap().len(), 6);
    assert_eq!(saved[0]["model"]["sha256"].as_str().unwrap().len(), 64);
    ok(at, "eval --model a --data sim --points 500");
    assert_eq!(
        kept(&at.join("a")).len(),
        1,
        "repeating an evaluation replaces its file"
    );

    // Side by side.
    let evaluate = "hint: evaluate it first: deepfusion eval --model b";
    fails(at, "compare a b", &["b: has no evaluation", evaluate]);
    fs::create_dir(at.join("no-run")).unwrap();
    fails(at, "compare no-run", &["hint: give a run's folder"]);
    ok(at, "eval --model b --data sim");
    fs::write(at.join("printed.json"), &printed).unwrap();
    let text = ok(at, "compare a b printed.json");
    assert!(
        text.contains("6 images, Garg's crop") && !text.contains("groups that differ"),
        "{text}"
    );
    assert!(
        text.contains("every figure equals those of `printed`"),
        "{text}"
    );
    ok(at, "eval --model b --data sim --crop none");
    assert!(ok(at, "compare a b").contains("2 groups that differ"));
    assert!(ok(at, "compare a --format latex").contains("\\toprule"));
    let csv = ok(at, "compare a b --published --format csv");
    assert!(csv.starts_with("table,run,abs_rel") && csv.contains("Monodepth2"));
    let written = support::ok(
        at,
        "compare a b --format html --pictures sim --picture-count 2 --out c.html",
    );
    let notes = &written.stderr;
    assert!(
        notes.contains("c.png") && notes.contains("c.html"),
        "{notes}"
    );
    assert!(page(&at.join("c.html")).contains("<div class=\"grid\""));
    let sheet = fs::read(at.join("c.png")).unwrap();
    assert!(sheet.starts_with(b"\x89PNG"));

    // Continued training writes other weights under the same name.
    fs::write(at.join("a/best.safetensors"), "other").unwrap();
    assert!(ok(at, "compare a").contains("has changed since"));

    fails(
        at,
        "compare a printed.json --pictures sim --out d.html",
        &["expected a run's folder for the pictures"],
    );
    fs::write(at.join("broken.json"), &printed[..printed.len() / 2]).unwrap();
    fails(at, "compare broken.json", &["not an evaluation"]);
    fails(at, "compare nowhere.json", &["nowhere.json"]);
    let bad = run(at, "compare");
    assert_eq!(bad.code, 2, "{}", bad.stderr);
}

#[test]
fn arrays_have_a_report_too() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    let truth =
        ndarray::Array3::<f32>::from_shape_fn((3, 12, 20), |(i, y, x)| (5 + i + y + x) as f32);
    ndarray_npy::write_npy(at.join("gt.npy"), &truth).unwrap();
    ndarray_npy::write_npy(at.join("pred.npy"), &truth.mapv(|d| 1.1 * d)).unwrap();
    let args = "eval --pred pred.npy --pred-kind depth --gt gt.npy --points 50 --report r.html";
    let text = ok(at, args);
    assert!(text.contains("distance along z, m (no camera)"), "{text}");
    let html = page(&at.join("r.html"));
    assert!(html.contains("Best and worst frames") && !html.contains("Learning curves"));
    fails(at, &args.replace("r.html", "no/such/r.html"), &["no/such"]);
}
