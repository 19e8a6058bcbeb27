//! A network that predicts its uncertainty: trained, calibrated, packed, written.

use std::fs;
use std::path::Path;

use crate::support::{self, fails, json, ok};
use serde_json::Value;

/// A run that predicts only depth, and one that starts from it and adds the uncertainty head.
fn train(at: &Path) {
    for (drive, seed) in [("sim", 3), ("other", 4)] {
        ok(
            at,
            &format!(
                "simulate --out {drive} --frames 12 --seed {seed} --scan-every 3 --size 160x96"
            ),
        );
    }
    ok(
        at,
        "train --data sim --learn depth --size 96x64 --batch 2 --steps 2 --init none --out plain",
    );
    let config = fs::read_to_string(at.join("plain/config.toml")).unwrap();
    let mut config: toml::Table = config.parse().unwrap();
    let net = config["depth_net"].as_table_mut().unwrap();
    net.insert("uncertainty".into(), true.into());
    fs::write(at.join("sure.toml"), config.to_string()).unwrap();
    let begun = ok(
        at,
        "train --config sure.toml --init plain/last.safetensors --steps 3 --out sure",
    );
    assert!(
        begun.stderr.contains("new: the uncertainty head"),
        "{}",
        begun.stderr
    );
    let log = fs::read_to_string(at.join("sure/log.csv")).unwrap();
    let column = log.lines().next().unwrap().split(',');
    let column = column.clone().position(|c| c == "uncertainty").unwrap();
    let first = log.lines().nth(1).unwrap().split(',').nth(column).unwrap();
    assert!(first.parse::<f64>().unwrap() != 0.0, "{log}");
}

/// Each point has its pixel's sigma; points with a large sigma are left out if asked for, and `perceive` adds sigma to its targets and
/// keeps it for the viewer.
fn clouds_carry_it(at: &Path) {
    let cloud = |options: &str, out: &str| {
        ok(
            at,
            &format!(
                "predict --model sure other --save ply,npy,sigma,confidence {options} --out {out}"
            ),
        );
        let path = at.join(out).join("0000000000.ply");
        let bytes = fs::read(&path).unwrap();
        deepfusion_geometry::cloud::PointCloud::read_ply(bytes.as_slice()).unwrap()
    };
    let all = cloud("", "all");
    let pixels = 160 * 96;
    let map = |ending: &str| values(&at.join(format!("all/0000000000_{ending}.npy")), pixels);
    let (depth, sigma) = (map("depth"), map("sigma"));
    // exp(−expected error), from the sigma that is written beside it; 0 outside of what the network saw.
    for (found, (z, s)) in map("confidence").iter().zip(depth.iter().zip(&sigma)) {
        if *z > 0.0 {
            let expected = (-s / (std::f32::consts::SQRT_2 * z)).exp();
            assert!((expected - found).abs() < 1e-6, "{z}, {s}: {found}");
            assert!(*found > 0.0 && *found < 1.0, "{found}");
        } else {
            assert_eq!(*found, 0.0);
        }
    }
    let of_points = depth.iter().zip(&sigma);
    let of_points = of_points.filter(|(z, _)| **z > 0.0 && **z <= 80.0);
    let expected: Vec<f32> = of_points.clone().map(|(_, s)| *s).collect();
    assert_eq!(all.sigma.unwrap(), expected);
    // The median, so that there are points on both sides.
    let mut shares: Vec<f32> = of_points.map(|(z, s)| s / z).collect();
    shares.sort_by(f32::total_cmp);
    let most = shares[shares.len() / 2] * 1.0001;
    let sure = cloud(&format!("--max-sigma {most}"), "sure-points");
    assert!(sure.len() < all.xyz.len() && sure.len() * 3 > all.xyz.len());
    let (points, sigma) = (&sure.xyz, sure.sigma.as_ref().unwrap());
    let worst = points.iter().zip(sigma).map(|(p, s)| s / p[2]);
    assert!(worst.fold(0.0, f32::max) <= most * 1.001);

    ok(at, "perceive --model sure other --save sigma --out seen");
    let kept = fs::read_dir(at.join("seen")).unwrap();
    let names = kept.map(|f| f.unwrap().file_name().into_string().unwrap());
    assert!(names.into_iter().any(|name| name.ends_with("_sigma.npy")));
}

/// The values of an array file of f32, row by row.
fn values(path: &Path, count: usize) -> Vec<f32> {
    let bytes = fs::read(path).unwrap();
    let of = bytes[bytes.len() - 4 * count..].chunks_exact(4);
    of.map(|b| f32::from_le_bytes(b.try_into().unwrap()))
        .collect()
}

#[test]
fn uncertainty_is_evaluated_calibrated_and_written() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    train(at);
    let levels = |report: &Value| -> Vec<[f64; 3]> {
        let rows = report["intervals"]["levels"].as_array().unwrap();
        let number = |row: &Value, field: &str| row[field].as_f64().unwrap();
        rows.iter()
            .map(|row| ["level", "coverage", "width_rel"].map(|field| number(row, field)))
            .collect()
    };
    let plain = json(at, "eval --model plain --data other --crop none --json");
    assert!(plain.get("intervals").is_none());
    let eval = "eval --model sure --data other --crop none";
    let word = json(at, &format!("{eval} --json"));
    assert_eq!(word["intervals"]["calibrated"], false);
    let nominal: Vec<f64> = levels(&word).iter().map(|row| row[0]).collect();
    assert_eq!(nominal, [0.5, 0.8, 0.95]);

    for (command, names) in [
        (
            "predict --model plain other --save sigma --out no",
            ["does not predict uncertainty", "sigma"],
        ),
        (
            "predict --model plain other --save confidence --out no",
            ["does not predict uncertainty", "confidence"],
        ),
        (
            "eval --model plain --data other --calibrate-uncertainty",
            ["does not predict uncertainty", "uncertainty"],
        ),
        (
            "predict --model plain other --save ply --max-sigma 0.2 --out no",
            ["does not predict uncertainty", "--max-sigma"],
        ),
    ] {
        fails(at, command, &names);
    }
    assert!(!at.join("no").exists());

    let before = &json(
        at,
        "predict --model sure other --save sigma,npy --out word --json",
    )[0];
    let found = ok(at, &format!("{eval} --calibrate-uncertainty")).stdout;
    assert!(
        found.contains("(the pixels they were calibrated on)"),
        "{found}"
    );
    assert!(at.join("sure/uncertainty.toml").exists());
    let held = json(at, &format!("{eval} --json"));
    assert!(held["intervals"].get("in_sample").is_none(), "{held}");
    assert_eq!(held["intervals"]["calibrated"], true);
    // On the data of their calibration, the intervals have their nominal coverage, except for pixels with equal scores.
    for [level, coverage, width] in levels(&held) {
        assert!((coverage - level).abs() < 0.02, "{level}: {coverage}");
        assert!(width > 0.0);
    }
    let table = ok(at, eval).stdout;
    assert!(
        table.contains("sigma   the 80 % intervals contain") && table.contains("(calibrated)"),
        "{table}"
    );

    // Sigma is scaled like the 80 % interval, and earlier outputs are written again.
    let after = &json(
        at,
        "predict --model sure other --save sigma,npy --out word --overwrite --json",
    )[0];
    assert_ne!(
        before["made_with"]["weights"],
        after["made_with"]["weights"]
    );
    let file = |sidecar: &Value, ending: &str| {
        let files = sidecar["files"].as_array().unwrap().iter();
        let mut names = files.map(|f| f.as_str().unwrap().to_owned());
        at.join("word")
            .join(names.find(|f| f.ends_with(ending)).unwrap())
    };
    let pixels = 160 * 96;
    let depth = values(&file(after, "_depth.npy"), pixels);
    let sigma = values(&file(after, "_sigma.npy"), pixels);
    let known = depth.iter().zip(&sigma).filter(|(d, _)| **d > 0.0);
    assert!(known.clone().count() > 1000);
    assert!(known.clone().all(|(_, s)| *s > 0.0 && s.is_finite()));

    clouds_carry_it(at);

    let card = json(
        at,
        "weights pack --model sure --checkpoint last --name hut --out packed --json",
    );
    assert_eq!(card["name"], "hut");
    let text = fs::read_to_string(at.join("packed/hut.toml")).unwrap();
    let table: toml::Table = text.parse().unwrap();
    assert_eq!(table["uncertainty"]["levels"].as_array().unwrap().len(), 3);
    let packed = json(
        at,
        "eval --model packed/hut.safetensors --data other --crop none --json",
    );
    assert_eq!(packed["intervals"]["calibrated"], true);
    // A preset's network starts from it, without the head.
    ok(
        at,
        "train --data sim --size 96x64 --batch 2 --steps 1 --init packed/hut.safetensors --out on",
    );
    // An exported file contains only depth.
    ok(at, "export --model sure --out sure.onnx");

    let kept = at.join("sure/uncertainty.toml");
    let good = fs::read_to_string(&kept).unwrap();
    // Factors of another step of the network are not used, and a warning says so.
    fs::write(&kept, good.replacen("step = ", "step = 9", 1)).unwrap();
    let stale = ok(at, "predict --model sure sim --save sigma --out stale");
    assert!(
        stale.stderr.contains("measured for the network at step 9"),
        "{}",
        stale.stderr
    );
    let impossible = good.replacen("factors = [", "factors = [-1.0, 1.0, 1.0] # ", 1);
    assert_ne!(impossible, good);
    for wrong in ["levels = [0.5]", &impossible] {
        fs::write(&kept, wrong).unwrap();
        let run = support::run(at, eval);
        assert_eq!(run.code, 1, "{wrong}: {}", run.stderr);
        assert!(run.stderr.contains("uncertainty.toml"), "{}", run.stderr);
    }
}
