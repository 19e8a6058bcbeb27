//! Properties that hold for any numbers.

use deepfusion_eval::{
    Crop, Error, Evaluator, Grid, Holes, Metrics, Prediction, Protocol, Report, Sample,
};
use deepfusion_hint::Hint;
use proptest::prelude::*;

const WIDTH: usize = 16;
const HEIGHT: usize = 9;

fn depths() -> impl Strategy<Value = Vec<f64>> {
    prop::collection::vec(1.0..60.0f64, WIDTH * HEIGHT)
}

fn grid(values: &[f64]) -> Grid {
    Grid::new(WIDTH, HEIGHT, values.to_vec()).unwrap()
}

fn report(prediction: &Prediction, truth: &Grid) -> Report {
    let mut evaluator = Evaluator::new(Protocol::default()).unwrap();
    evaluator.add("image", prediction, truth).unwrap();
    evaluator.report().unwrap()
}

proptest! {
    #[test]
    fn a_perfect_prediction_has_no_error(depth in depths()) {
        let truth = grid(&depth);
        let report = report(&Prediction::Depth(truth.clone()), &truth);
        prop_assert!(report.unscaled.abs_rel < 1e-12 && report.unscaled.rmse_log < 1e-12);
        prop_assert_eq!(report.unscaled.a1, 1.0);
        prop_assert!((report.scale.median - 1.0).abs() < 1e-12);
        prop_assert_eq!(report.scale.bias_ci95, None);
    }

    /// Predictions s times as far away: the ratio is 1/s, the bias is ln s, and median scaling undoes s.
    #[test]
    fn scale_is_measured_and_removed(truth in depths(), pred in depths(), s in 0.2..5.0f64) {
        let truth = grid(&truth);
        let scaled: Vec<f64> = pred.iter().map(|d| d * s).collect();
        let (one, other) = (report(&Prediction::Depth(grid(&pred)), &truth), report(&Prediction::Depth(grid(&scaled)), &truth));
        prop_assert!((other.scale.median * s / one.scale.median - 1.0).abs() < 1e-12);
        prop_assert!((other.scale.bias - one.scale.bias - s.ln()).abs() < 1e-12);
        prop_assert!((other.median_scaled.abs_rel - one.median_scaled.abs_rel).abs() < 1e-12);
    }

    #[test]
    fn depth_and_disparity_score_the_same(truth in depths(), pred in depths(), w in 1usize..40, h in 1usize..20) {
        let values: Vec<f64> = pred.iter().copied().cycle().take(w * h).collect();
        let inverse = values.iter().map(|d| 1.0 / d).collect();
        let depth = Prediction::Depth(Grid::new(w, h, values).unwrap());
        let disparity = Prediction::Disparity(Grid::new(w, h, inverse).unwrap());
        prop_assert_eq!(report(&depth, &grid(&truth)), report(&disparity, &grid(&truth)));
    }

    /// However odd the prediction, no metric is NaN or infinite: serde_json would write `null` for it.
    #[test]
    fn reports_have_no_nan(truth in depths(), exponents in prop::collection::vec(-300.0..300.0f64, WIDTH * HEIGHT)) {
        let pred: Vec<f64> = exponents.iter().map(|e| 10f64.powf(*e)).collect();
        let json = serde_json::to_value(report(&Prediction::Depth(grid(&pred)), &grid(&truth))).unwrap();
        for part in ["unscaled", "median_scaled"] {
            for name in Metrics::NAMES {
                prop_assert!(json[part][name].is_f64(), "{part} {name} {}", json[part][name]);
            }
        }
    }

    #[test]
    fn the_ranges_count_every_pixel_once(truth in depths(), pred in depths()) {
        let report = report(&Prediction::Depth(grid(&pred)), &grid(&truth));
        prop_assert_eq!(report.ranges.iter().map(|r| r.n).sum::<usize>(), WIDTH * HEIGHT);
        let pooled: f64 = report.ranges.iter().filter_map(|r| Some(r.abs_rel? * r.n as f64)).sum();
        prop_assert!((pooled / (WIDTH * HEIGHT) as f64 - report.unscaled.abs_rel).abs() < 1e-12);
    }
}

#[test]
fn static_and_moving_pixels_make_up_the_image() {
    let truth = grid(&[10.0; WIDTH * HEIGHT]);
    let moving: Vec<bool> = (0..WIDTH * HEIGHT).map(|i| i % WIDTH < 4).collect();
    let pred: Vec<f64> = moving
        .iter()
        .map(|m| if *m { 20.0 } else { 11.0 })
        .collect();
    let prediction = Prediction::Depth(grid(&pred));
    let mut evaluator = Evaluator::new(Protocol::default()).unwrap();
    let sample = Sample {
        name: "image",
        prediction: &prediction,
        ground_truth: &truth,
        moving: Some(&moving),
        intrinsics: None,
        dense: None,
    };
    evaluator.add_sample(&sample).unwrap();
    let report = evaluator.report().unwrap();
    assert!((report.moving.unwrap().abs_rel - 1.0).abs() < 1e-12);
    assert!((report.still.unwrap().abs_rel - 0.1).abs() < 1e-12);
    assert!((report.unscaled.abs_rel - (0.25 + 0.75 * 0.1)).abs() < 1e-12);
    let json = serde_json::to_value(&report).unwrap();
    assert!(json["static"]["abs_rel"].is_f64() && json.get("still").is_none());

    let short = Sample {
        moving: Some(&moving[1..]),
        ..sample
    };
    assert!(matches!(
        evaluator.add_sample(&short),
        Err(Error::Shape { .. })
    ));
}

#[test]
fn invalid_predictions_are_refused_or_counted() {
    let truth = grid(&[10.0; WIDTH * HEIGHT]);
    for bad in [f64::NAN, f64::INFINITY, 0.0, -3.0] {
        let mut values = vec![10.0; WIDTH * HEIGHT];
        values[WIDTH + 3] = bad;
        let prediction = Prediction::Depth(grid(&values));
        let error = Evaluator::new(Protocol::default())
            .unwrap()
            .add("0000000007", &prediction, &truth)
            .unwrap_err();
        let text = error.to_string();
        assert!(
            text.contains("`0000000007`") && text.contains("column 3, row 1"),
            "{text}"
        );
        assert!(error.hint().unwrap().contains("allow holes"));

        let mut evaluator = Evaluator::new(Protocol {
            holes: Holes::Skip,
            ..Protocol::default()
        })
        .unwrap();
        evaluator.add("0000000007", &prediction, &truth).unwrap();
        let report = evaluator.report().unwrap();
        assert_eq!(report.missing_rate, Some(1.0 / (WIDTH * HEIGHT) as f64));
        assert!(report.unscaled.abs_rel < 1e-12);
    }
}

#[test]
fn images_without_ground_truth_are_skipped_and_named() {
    let (truth, none) = (grid(&[10.0; WIDTH * HEIGHT]), grid(&[0.0; WIDTH * HEIGHT]));
    let prediction = Prediction::Depth(truth.clone());
    let mut evaluator = Evaluator::new(Protocol {
        crop: Crop::Garg,
        ..Protocol::default()
    })
    .unwrap();
    assert!(
        evaluator
            .add("empty", &prediction, &none)
            .unwrap()
            .is_none()
    );
    let error = evaluator.report().unwrap_err().to_string();
    assert!(error.contains("empty"), "{error}");
    evaluator.add("full", &prediction, &truth).unwrap();
    let report = evaluator.report().unwrap();
    assert_eq!((report.n, report.skipped), (1, vec!["empty".to_owned()]));
}

#[test]
fn drawn_points_measure_distances_in_space() {
    let truth = grid(&[10.0; WIDTH * HEIGHT]);
    let prediction = Prediction::Depth(grid(&[11.0; WIDTH * HEIGHT]));
    let mut evaluator = Evaluator::new(Protocol {
        points: 30,
        ..Protocol::default()
    })
    .unwrap();
    evaluator.add("image", &prediction, &truth).unwrap();
    let along_z = evaluator.report().unwrap().points.unwrap();
    assert!(!along_z.in_space);
    let along_z = along_z.unscaled;
    assert_eq!(along_z.n, 30);
    assert!((along_z.mean_m.unwrap() - 1.0).abs() < 1e-12 && along_z.std_m.unwrap() < 1e-12);

    // A camera so wide that a ray to the border with z = 1 is at least √2 long.
    let k = deepfusion_geometry::Intrinsics {
        fx: 8.0,
        fy: 8.0,
        cx: 7.5,
        cy: 4.0,
        width: 16,
        height: 9,
    };
    let mut evaluator = Evaluator::new(Protocol {
        points: 30,
        ..Protocol::default()
    })
    .unwrap();
    let sample = Sample {
        name: "i",
        prediction: &prediction,
        ground_truth: &truth,
        moving: None,
        intrinsics: Some(&k),
        dense: None,
    };
    evaluator.add_sample(&sample).unwrap();
    let in_space = evaluator.report().unwrap().points.unwrap();
    assert!(in_space.in_space && in_space.unscaled.mean_m.unwrap() > 1.05);
    assert!(in_space.median_scaled.mean_m.unwrap() < 1e-12);
    assert_eq!(evaluator.drawn_points().len(), 30);
    let in_ranges: usize = in_space.ranges.iter().map(|r| r.unscaled.n).sum();
    assert_eq!(in_ranges, 30);
}
