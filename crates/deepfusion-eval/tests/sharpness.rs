//! Sharpness by hand, and against scikit-image's Canny and SciPy's distance transform
//! (`tests/reference/sharpness.py`).
//!
//! Tolerance: 1e-9 relative. Both sides compute in `f64` from the same file values. The mean distances agree only if every pixel of both
//! edge maps agrees: one that differs changes them by 1e-3 or more.

use std::fs::File;
use std::path::Path;

use deepfusion_eval::{
    Crop, Evaluator, Grid, ImageSharpness, Prediction, Protocol, Report, Sample,
};
use ndarray::Array2;
use ndarray_npy::NpzReader;
use serde_json::Value;

const SIZE: (usize, usize) = (80, 24);

/// A map with the same values in every row.
fn columns((width, height): (usize, usize), depth: impl Fn(usize) -> f64) -> Grid {
    Grid::new(
        width,
        height,
        (0..width * height).map(|i| depth(i % width)).collect(),
    )
    .unwrap()
}

/// 5 m, then 20 m from the column `at` on.
fn step(at: usize) -> impl Fn(usize) -> f64 {
    move |x| if x < at { 5.0 } else { 20.0 }
}

fn sharpness(truth: &Grid, predicted: Grid) -> Option<ImageSharpness> {
    ImageSharpness::of(truth, &Prediction::Depth(predicted), &Protocol::default())
}

/// Accuracy and completeness of a prediction of the step at column 20.
#[track_caller]
fn errors(predicted: impl Fn(usize) -> f64) -> [f64; 2] {
    let boundary = sharpness(&columns(SIZE, step(20)), columns(SIZE, predicted))
        .unwrap()
        .boundary
        .unwrap();
    [boundary.accuracy_px, boundary.completeness_px]
}

#[test]
fn a_boundary_in_the_wrong_place_has_that_distance() {
    for shift in [0, 1, 3, 9] {
        let distance = shift as f64;
        assert_eq!(errors(step(20 + shift)), [distance; 2], "{shift} px right");
        assert_eq!(errors(step(20 - shift)), [distance; 2], "{shift} px left");
    }
    // From 10 px on it is another boundary: the true one is missed, and the predicted one has no counterpart.
    for shift in [10, 14] {
        assert_eq!(errors(step(20 + shift)), [10.0; 2], "{shift}");
    }
}

#[test]
fn missed_boundaries_count_for_completeness_and_invented_ones_for_neither() {
    assert_eq!(errors(|_| 7.0), [10.0; 2]);
    // A second boundary 30 px away.
    let invented = |x: usize| if x < 50 { step(20)(x) } else { 35.0 };
    assert_eq!(errors(invented), [0.0; 2]);
    let two = columns(SIZE, invented);
    let one = sharpness(&two, columns(SIZE, step(20))).unwrap();
    let boundary = one.boundary.unwrap();
    assert_eq!(
        [boundary.accuracy_px, boundary.completeness_px],
        [0.0, 5.0],
        "half of the boundaries are missed"
    );
}

#[test]
fn blur_keeps_the_boundary_and_gives_flying_pixels() {
    // Between 5 m and 20 m over six pixels; the middle is at the true boundary. The four pixels of a row near the jump, 18 to 21, are all
    // more than 10 % from both depths.
    let blurred = |x: usize| 5.0 + 15.0 * ((x as f64 - 16.5) / 6.0).clamp(0.0, 1.0);
    let truth = columns(SIZE, step(20));
    let seen = sharpness(&truth, columns(SIZE, blurred)).unwrap();
    assert!(seen.boundary.unwrap().accuracy_px <= 1.0, "{seen:?}");
    assert_eq!(seen.flying_share, Some(1.0));
    // A sharp boundary in the wrong place has no flying pixels.
    let moved = sharpness(&truth, columns(SIZE, step(23))).unwrap();
    assert_eq!(moved.flying_share, Some(0.0));
}

#[test]
fn bilinear_enlargement_gives_the_expected_share_of_flying_pixels() {
    // Disparities 0.2 and 0.05. Enlarged k times, they blend in the k pixels around the boundary, at (i + ½)/k of the way. Four pixels of
    // each row are near the jump.
    let truth = columns(SIZE, step(24));
    for (k, flying) in [(2, 2.0), (4, 4.0), (8, 4.0)] {
        let small = columns((SIZE.0 / k, SIZE.1 / k), step(24 / k));
        let seen = sharpness(&truth, small).unwrap();
        assert_eq!(seen.flying_share, Some(flying / 4.0), "{k} times");
        // A constant slope in disparity is steepest in depth at its far end, so the boundary is found there.
        assert!(seen.boundary.unwrap().accuracy_px <= k as f64 / 2.0);
    }
}

#[test]
fn scale_and_depth_beyond_the_cap_do_not_affect_sharpness() {
    let exact = Some([0.0; 3]);
    let all = |truth: &Grid, predicted: Grid| {
        let s = sharpness(truth, predicted)?;
        let b = s.boundary?;
        Some([b.accuracy_px, b.completeness_px, s.flying_share?])
    };
    let truth = columns(SIZE, step(20));
    assert_eq!(all(&truth, columns(SIZE, |x| 1.7 * step(20)(x))), exact);
    // The sky's border is a boundary, whatever depth is predicted for the sky.
    let sky = columns(SIZE, |x| if x < 60 { 9.0 } else { f64::INFINITY });
    for far in [80.0, 300.0] {
        let seen = |x: usize| if x < 60 { 9.0 } else { far };
        assert_eq!(all(&sky, columns(SIZE, seen)), exact, "{far} m");
    }
    assert_eq!(
        all(&sky, columns(SIZE, |_| 9.0)).map(|e| e[1]),
        Some(10.0),
        "sky predicted at the object's depth is missed"
    );
    // Unknown pixels are not sky: their border is not a boundary.
    let unknown = columns(SIZE, |x| if x < 60 { 9.0 } else { 0.0 });
    let seen = sharpness(&unknown, columns(SIZE, step(70))).unwrap();
    assert_eq!((seen.boundary, seen.flying_share), (None, None));
}

#[test]
fn sparse_or_tiny_truth_gives_no_sharpness() {
    let every = |n: usize| columns(SIZE, move |x| if x % n == 0 { 5.0 } else { f64::NAN });
    let flat = || columns(SIZE, |_| 5.0);
    assert!(sharpness(&every(2), flat()).is_some());
    assert_eq!(sharpness(&every(3), flat()), None);
    assert_eq!(sharpness(&columns((80, 20), step(20)), flat()), None);
    let all_sky = columns(SIZE, |_| f64::INFINITY);
    assert_eq!(sharpness(&all_sky, flat()), None);
}

#[test]
fn means_use_only_images_with_a_value() {
    let scan = columns(SIZE, |x| if x % 9 == 0 { step(20)(x) } else { 0.0 });
    let dense = columns(SIZE, step(20));
    let flat = columns(SIZE, |_| 5.0);
    let mut evaluator = Evaluator::new(Protocol::default()).unwrap();
    let mut add = |dense: Option<&Grid>, truth: &Grid, predicted: Grid| {
        let sample = Sample {
            name: "image",
            prediction: &Prediction::Depth(predicted),
            ground_truth: truth,
            moving: None,
            intrinsics: None,
            dense,
        };
        evaluator.add_sample(&sample).unwrap();
        evaluator.report().unwrap()
    };
    let none = add(None, &scan, columns(SIZE, step(20)));
    assert_eq!(none.sharpness, None);
    assert!(!none.to_string().contains("edges   "), "{none}");
    assert!(
        serde_json::to_value(&none)
            .unwrap()
            .get("sharpness")
            .is_none()
    );

    // A sparse scan beside dense depth, then dense depth as the ground truth itself.
    add(Some(&dense), &scan, columns(SIZE, step(23)));
    add(None, &dense, columns(SIZE, step(21)));
    let report = add(None, &flat, columns(SIZE, |_| 5.0));
    let json = serde_json::to_value(&report).unwrap();
    assert_eq!(
        json["sharpness"],
        serde_json::json!({
            "boundary_accuracy_px": 2.0, "boundary_completeness_px": 2.0, "flying_share": 0.0,
            "images": 3, "boundary_images": 2, "flying_images": 2,
        })
    );
    assert_eq!(serde_json::from_value::<Report>(json).unwrap(), report);
    let text = report.to_string();
    assert!(
        text.contains(
            "edges   2.00 px from the true ones (accuracy), 2.00 px including missed ones (completeness); 2 images\n\
             flying  0.0 % of the pixels at depth jumps lie between the two sides; 2 images\n"
        ),
        "{text}"
    );
}

#[test]
fn every_case_equals_scikit_image() {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/reference");
    let text = std::fs::read_to_string(folder.join("sharpness.json")).unwrap();
    let cases: Vec<Value> = serde_json::from_str(&text).unwrap();
    let mut arrays = NpzReader::new(File::open(folder.join("sharpness.npz")).unwrap()).unwrap();
    let mut read = |name: &Value| {
        let name = name.as_str().unwrap();
        let array: Array2<f32> = arrays.by_name(name).unwrap();
        let (height, width) = array.dim();
        Grid::from_f32(width, height, array.as_slice().unwrap()).unwrap()
    };
    assert_eq!(cases.len(), 14);
    for case in &cases {
        let what = format!("{} {}", case["prediction"], case["crop"]);
        let protocol = Protocol {
            crop: if case["crop"] == "garg" {
                Crop::Garg
            } else {
                Crop::None
            },
            ..Protocol::default()
        };
        let prediction = Prediction::Depth(read(&case["prediction"]));
        let ours = ImageSharpness::of(&read(&case["truth"]), &prediction, &protocol).unwrap();
        let boundary = ours.boundary.unwrap();
        for (name, value) in [
            ("accuracy_px", boundary.accuracy_px),
            ("completeness_px", boundary.completeness_px),
            ("flying_share", ours.flying_share.unwrap()),
        ] {
            let theirs = case[name].as_f64().unwrap();
            assert!(
                (value - theirs).abs() <= 1e-9 * theirs.max(1e-3),
                "{what} {name}: {value} != {theirs}"
            );
        }
    }
}
