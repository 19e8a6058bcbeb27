//! Pixels of a prediction of which the true depth is known.

use std::ops::Range;

use deepfusion_eval::Grid;
use deepfusion_runtime::Prediction;

/// Pixels taken of each frame, at most.
const PIXELS: usize = 4_000;

/// The network's pixels, by their place in [`Prediction::disparity`], with the true depth in metres: evenly among those of the
/// truth that are within the range, some thousands. The truth is of the whole image, and so is the prediction.
#[must_use]
pub fn known_pixels(truth: &Grid, seen: &Prediction, range_m: &Range<f64>) -> Vec<(usize, f64)> {
    let known: Vec<(usize, f64)> = truth
        .values()
        .iter()
        .enumerate()
        .filter(|(_, z)| range_m.contains(*z))
        .map(|(i, z)| (i, *z))
        .collect();
    let step = known.len().div_ceil(PIXELS).max(1);
    let (width, height) = (truth.width(), truth.height());
    let place = |(i, z): (usize, f64)| {
        // The network's pixel at the truth's.
        let u = (2 * (i % width) + 1) * seen.width / (2 * width);
        let v = (2 * (i / width) + 1) * seen.height / (2 * height);
        (v * seen.width + u, z)
    };
    known.into_iter().step_by(step).map(place).collect()
}
