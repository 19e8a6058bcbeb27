//! The on/off table through the program: made, continued, and refused.

use std::fs;

use crate::support::{ok, run};
use serde_json::Value;

#[test]
fn the_table_grows_by_seeds_and_keeps_what_is_done() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    ok(
        at,
        "simulate --out sim --frames 10 --seed 3 --scan-every 4 --moving-cars 3",
    );
    let settings = "--preset tiny --size 96x64 --batch 2 --budget 2 --set loss.smoothness=0.02";
    ok(
        at,
        &format!("ablate --data sim {settings} --rows hce+speed+flow,none,minimum --out table"),
    );
    for file in [
        "table.txt",
        "table.csv",
        "table.md",
        "table.tex",
        "ablate.toml",
    ] {
        assert!(at.join("table").join(file).is_file(), "{file}");
    }
    let csv = fs::read_to_string(at.join("table/table.csv")).unwrap();
    let rows: Vec<_> = csv
        .lines()
        .skip(1)
        .map(|l| l.split(',').next().unwrap())
        .collect();
    assert_eq!(rows, ["hce+speed+flow", "none", "minimum"]);
    // A row's run has off what the row switches off.
    let config = |row: &str| {
        fs::read_to_string(at.join(format!("table/rows/{row}/seed-0/run/config.toml"))).unwrap()
    };
    assert!(config("hce+speed+flow").contains("[depth_net.hce]"));
    assert!(!config("none").contains("[depth_net.hce]"));
    assert!(config("minimum").contains("reprojection = \"minimum\""));
    for row in ["hce+speed+flow", "none", "minimum"] {
        // The context does not switch on attention, nor the flow masks; and no row warps with measured motion.
        assert!(!config(row).contains("[depth_net.attention]"), "{row}");
        assert!(
            config(row).contains("[loss.moving]\nenabled = false"),
            "{row}"
        );
        assert!(config(row).contains("view_motion = \"posenet\""), "{row}");
        assert!(config(row).contains("\nsmoothness = 0.02\n"), "{row}");
    }
    let header = csv.lines().next().unwrap();
    for column in [
        "abs_rel",
        "sq_rel",
        "rmse",
        "rmse_log",
        "a1",
        "a2",
        "a3",
        "train_hours",
        "parameters_m",
    ] {
        assert!(
            header.contains(&format!(",{column},{column}_std")),
            "{header}"
        );
    }

    // A second seed is added: finished runs are not repeated, and one that is half done is continued.
    let result = at.join("table/rows/none/seed-0/result.json");
    let before = fs::metadata(&result).unwrap().modified().unwrap();
    fs::remove_file(at.join("table/rows/minimum/seed-0/result.json")).unwrap();
    let table: Value =
        serde_json::from_str(&ok(at, "ablate --out table --resume --seeds 2 --json").stdout)
            .unwrap();
    assert_eq!(fs::metadata(&result).unwrap().modified().unwrap(), before);
    let rows = table.as_array().unwrap();
    assert_eq!(rows.len(), 3);
    for row in rows {
        assert_eq!(row["seeds"], 2);
        let abs_rel = &row["figures"]["abs_rel"];
        assert!(abs_rel["mean"].as_f64().unwrap() > 0.01, "{row}");
        assert!(abs_rel["std"].as_f64().unwrap() > 0.0, "{row}");
    }
    let text = fs::read_to_string(at.join("table/table.txt")).unwrap();
    assert!(
        text.contains("evaluated on the training recordings"),
        "{text}"
    );
}

#[test]
fn an_impossible_table_is_refused() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    ok(at, "simulate --out sim --frames 6 --seed 3 --scan-every 0");
    for (args, names) in [
        (
            "ablate --data sim --budget 1 --rows hce+hope --out a",
            &["rows", "hce+hope", "hce+speed+flow"][..],
        ),
        (
            "ablate --data sim --budget 1 --rows none --view-motion distance --out c",
            &["view_motion", "distance", "--view-motion posenet"],
        ),
        (
            "ablate --data sim --budget 1 --set loss.smoothnes=0.1 --out d",
            &["loss.smoothnes=0.1", "config show"],
        ),
        (
            "ablate --data sim --budget 1 --set steps=3 --out e",
            &["steps=3", "--budget"],
        ),
        ("ablate --out nothing --resume", &["nothing", "ablate.toml"]),
        (
            "ablate --data sim --budget 1 --eval-data gone --out b",
            &["gone"],
        ),
        (
            "ablate --data sim --budget 1 --rows none --out f",
            &["has ground truth", "--eval-data"],
        ),
    ] {
        let run = run(at, args);
        assert_eq!(run.code, 1, "{args}: {}", run.stderr);
        for name in names {
            assert!(
                run.stderr.contains(name),
                "{args}: no `{name}` in {}",
                run.stderr
            );
        }
        assert!(!run.stderr.contains("panicked"), "{args}: {}", run.stderr);
    }
    let both = "ablate --data sim --budget 1 --with affine --without moving,affine --out g";
    let both = run(at, both);
    assert_eq!(both.code, 2, "{}", both.stderr);
    assert!(both.stderr.contains("--without affine"), "{}", both.stderr);
    assert!(!at.join("g").exists());
}
