//! Point distances against NumPy (`tests/reference/points.py`).
//!
//! Tolerance: 1e-9 relative. Both sides compute in `f64`. NumPy multiplies by an inverted K where this crate divides by the focal length,
//! and sums pairwise: together below 1e-12 for these sizes.

use std::path::Path;

use deepfusion_eval::{Evaluator, Grid, PointErrors, Points, Prediction, Protocol, Sample};
use deepfusion_geometry::Intrinsics;
use serde_json::Value;

fn reference() -> Value {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/reference/points.json");
    serde_json::from_str(&std::fs::read_to_string(path).unwrap()).unwrap()
}

fn numbers(value: &Value) -> Vec<f64> {
    let list = value.as_array().unwrap();
    list.iter().map(|v| v.as_f64().unwrap()).collect()
}

fn grid(size: &Value, values: &Value) -> Grid {
    let size = numbers(size);
    Grid::new(size[0] as usize, size[1] as usize, numbers(values)).unwrap()
}

fn evaluated(reference: &Value, points: usize, points_seed: u64) -> Evaluator {
    let camera = numbers(&reference["camera"]);
    let size = numbers(&reference["size"]);
    let k = Intrinsics {
        fx: camera[0],
        fy: camera[1],
        cx: camera[2],
        cy: camera[3],
        width: size[0] as u32,
        height: size[1] as u32,
    };
    let mut evaluator = Evaluator::new(Protocol {
        points,
        points_seed,
        ..Protocol::default()
    })
    .unwrap();
    for image in reference["images"].as_array().unwrap() {
        let depth = grid(&reference["prediction_size"], &image["depth"]);
        let sample = Sample {
            name: "image",
            prediction: &Prediction::Depth(depth),
            ground_truth: &grid(&reference["size"], &image["ground_truth"]),
            moving: None,
            intrinsics: Some(&k),
            dense: None,
        };
        evaluator.add_sample(&sample).unwrap();
    }
    evaluator
}

fn points(evaluator: &Evaluator) -> Points {
    evaluator.report().unwrap().points.unwrap()
}

#[track_caller]
fn close(ours: f64, theirs: f64) {
    assert!(
        (ours - theirs).abs() <= 1e-9 * theirs.abs().max(1e-3),
        "{ours} != {theirs}"
    );
}

#[track_caller]
fn equal(ours: &PointErrors, theirs: &Value) {
    assert_eq!(ours.n as u64, theirs["n"].as_u64().unwrap());
    for (value, name) in [
        (ours.mean_m, "mean_m"),
        (ours.std_m, "std_m"),
        (ours.sem_m, "sem_m"),
        (ours.sem_images_m, "sem_images_m"),
    ] {
        assert_eq!(value.is_some(), !theirs[name].is_null(), "{name}");
        if let Some(value) = value {
            close(value, theirs[name].as_f64().unwrap());
        }
    }
}

#[test]
fn distances_equal_numpys() {
    let reference = reference();
    // More than exist: all are drawn.
    let evaluator = evaluated(&reference, 10_000, 5);
    let ours = points(&evaluator);
    assert!(ours.in_space);
    equal(&ours.unscaled, &reference["unscaled"]);
    equal(&ours.median_scaled, &reference["median_scaled"]);
    let ranges = reference["ranges"].as_array().unwrap();
    assert_eq!(ours.ranges.len(), ranges.len());
    for (range, theirs) in ours.ranges.iter().zip(ranges) {
        equal(&range.unscaled, &theirs["unscaled"]);
        equal(&range.median_scaled, &theirs["median_scaled"]);
    }
    let first = evaluator.drawn_points()[0];
    for (ours, name) in [
        (first.truth, "first_truth"),
        (first.predicted, "first_predicted"),
    ] {
        for (ours, theirs) in ours.iter().zip(numbers(&reference[name])) {
            close(*ours, theirs);
        }
    }
}

#[test]
fn the_seed_decides_which_are_drawn() {
    let reference = reference();
    let drawn = |seed| evaluated(&reference, 40, seed).drawn_points().to_vec();
    assert_eq!(drawn(1), drawn(1));
    assert_ne!(drawn(1), drawn(2));
    assert_eq!(drawn(1).len(), 40);
    // The metrics do not depend on the drawing.
    let metrics = |seed| evaluated(&reference, 40, seed).report().unwrap().unscaled;
    assert_eq!(metrics(1), metrics(2));
}

#[test]
fn the_hash_depends_on_the_ground_truth_alone() {
    let mut reference = reference();
    let name = |reference: &Value| evaluated(reference, 0, 0).report().unwrap().truth_sha256;
    let first = name(&reference);
    assert_eq!(first.as_ref().map(String::len), Some(64));
    reference["images"][1]["depth"][3] = 7.0.into();
    assert_eq!(
        name(&reference),
        first,
        "predictions do not affect the hash"
    );
    let truth = &mut reference["images"][1]["ground_truth"];
    let place = truth
        .as_array()
        .unwrap()
        .iter()
        .position(|d| d.as_f64().unwrap() > 0.0)
        .unwrap();
    truth[place] = 3.25.into();
    assert_ne!(name(&reference), first);
}
