//! Compares with the protocol written in NumPy (`tests/reference/make_reference.py`).
//!
//! Tolerance: 1e-9 relative. Both sides compute in `f64` from the same file values. They differ in the order of sums (NumPy sums pairwise),
//! which stays below 1e-12 for these sizes. Thresholded shares (a1…a3) must agree in every pixel, which this tolerance implies: one pixel
//! of 4,000 is 2.5e-4.

use std::path::{Path, PathBuf};

use deepfusion_eval::{
    ArraySet, Crop, Evaluator, MeanDepthBaseline, Metrics, Prediction, Protocol, Report, Scaling,
    match_names,
};
use serde_json::Value;

fn folder() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/reference")
}

fn expected() -> Value {
    serde_json::from_str(&std::fs::read_to_string(folder().join("expected.json")).unwrap()).unwrap()
}

fn evaluate(case: &Value) -> Report {
    let file = |i: usize| folder().join(case["files"][i].as_str().unwrap());
    let (mut predictions, mut truth) = (
        ArraySet::open(&file(0)).unwrap(),
        ArraySet::open(&file(1)).unwrap(),
    );
    let mut evaluator = Evaluator::new(Protocol {
        crop: if case["crop"] == "garg" {
            Crop::Garg
        } else {
            Crop::None
        },
        cap_m: case["cap"].as_f64().unwrap(),
        min_m: case["min"].as_f64().unwrap(),
        scaling: case["factor"]
            .as_f64()
            .map_or(Scaling::None, Scaling::Fixed),
        ..Protocol::default()
    })
    .unwrap();
    for (name, predicted, known) in match_names(&predictions, &truth).unwrap() {
        let grid = predictions.read(predicted).unwrap();
        let prediction = if case["kind"] == "depth" {
            Prediction::Depth(grid)
        } else {
            Prediction::Disparity(grid)
        };
        evaluator
            .add(&name, &prediction, &truth.read(known).unwrap())
            .unwrap();
    }
    evaluator.report().unwrap()
}

#[track_caller]
fn close(what: &str, ours: f64, theirs: &Value) {
    let theirs = theirs.as_f64().unwrap();
    assert!(
        (ours - theirs).abs() <= 1e-9 * theirs.abs().max(1e-3),
        "{what}: {ours} != {theirs}"
    );
}

#[track_caller]
fn close_metrics(what: &str, ours: &Metrics, theirs: &Value) {
    for ((value, name), reference) in ours
        .to_array()
        .iter()
        .zip(Metrics::NAMES)
        .zip(theirs.as_array().unwrap())
    {
        close(&format!("{what} {name}"), *value, reference);
    }
}

#[test]
fn every_case_equals_numpy() {
    let expected = expected();
    let cases = expected["cases"].as_array().unwrap();
    assert_eq!(cases.len(), 9);
    for case in cases {
        let what = format!("{} {} cap {}", case["kind"], case["crop"], case["cap"]);
        let (ours, theirs) = (evaluate(case), &case["expected"]);
        assert_eq!(ours.n as u64, theirs["n"].as_u64().unwrap(), "{what}");
        close_metrics(
            &format!("{what} unscaled"),
            &ours.unscaled,
            &theirs["unscaled"],
        );
        close_metrics(
            &format!("{what} median-scaled"),
            &ours.median_scaled,
            &theirs["median_scaled"],
        );
        if let Some(fixed) = &ours.fixed_scaled {
            close_metrics(
                &format!("{what} fixed"),
                &fixed.metrics,
                &theirs["fixed_scaled"],
            );
        }
        close(&what, ours.scale.median, &theirs["scale"]["median"]);
        close(&what, ours.scale.std_rel, &theirs["scale"]["std_rel"]);
        close(&what, ours.scale.bias, &theirs["scale"]["bias"]);
        for (bin, reference) in ours.ranges.iter().zip(theirs["ranges"].as_array().unwrap()) {
            assert_eq!(
                bin.n as u64,
                reference["n"].as_u64().unwrap(),
                "{what} {}",
                bin.from_m
            );
            if bin.n > 0 {
                close(&what, bin.abs_rel.unwrap(), &reference["abs_rel"]);
                close(&what, bin.rmse.unwrap(), &reference["rmse"]);
            } else {
                assert_eq!((bin.abs_rel, bin.rmse), (None, None));
            }
        }
        let empty: &[&str] = if case["files"][1] == "gt.npz" {
            &["drive/empty"]
        } else {
            &[]
        };
        assert_eq!(ours.skipped, empty, "{what}");
    }
}

#[test]
fn the_mean_depth_baseline_equals_numpy() {
    let expected = expected();
    let mut scans = ArraySet::open(&folder().join("stack_gt.npy")).unwrap();
    let mut baseline = MeanDepthBaseline::new();
    for index in 0..scans.len() {
        baseline.add_scan(&scans.read(index).unwrap());
    }
    let own = scans.read(1).unwrap();
    for (depth, name) in [
        (baseline.depth_for(None), "trivial_all"),
        (baseline.depth_for(Some(&own)), "trivial_without_1"),
    ] {
        let depth = depth.unwrap();
        let theirs = expected[name].as_array().unwrap();
        assert_eq!(depth.values().len(), theirs.len());
        // The fixture keeps nine decimals.
        for (ours, theirs) in depth.values().iter().zip(theirs) {
            assert!((ours - theirs.as_f64().unwrap()).abs() < 1e-8, "{name}");
        }
    }
}
