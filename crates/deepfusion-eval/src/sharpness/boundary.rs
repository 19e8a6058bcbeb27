use serde::{Deserialize, Serialize};

use super::canny::edges;
use super::distance::to_nearest;
use super::pair::Pair;

/// Largest distance of a boundary from its counterpart, in pixels; beyond that, it counts as missed.
const REACH_PX: f64 = 10.0;

/// The depth boundary error of one image (Koch et al., "Evaluation of CNN-based Single-Image Depth Estimation Methods", 2018). E and E* are
/// the edges of the predicted and of the true depth, d(p, E) is a pixel's distance to the nearest of them.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct BoundaryError {
    /// Mean of d(p, E*) over the predicted edge pixels p with d(p, E*) < 10: how far the predicted boundaries are from their true place. 10
    /// if there are none, as in the authors' script, so that a prediction without boundaries is not left out of the mean.
    pub accuracy_px: f64,
    /// Mean of min(d(p, E), 10) over the true edge pixels p: the same distance for the true boundaries, where a missed one counts as 10.
    pub completeness_px: f64,
}

impl BoundaryError {
    /// `None` if the truth has no edge.
    pub(super) fn of(pair: &Pair) -> Option<Self> {
        let size = (pair.width, pair.height);
        let truth = edges(&pair.truth, &pair.known, size);
        if !truth.contains(&true) {
            return None;
        }
        let predicted = edges(&pair.prediction, &pair.known, size);
        let near = distances(&predicted, &to_nearest(&truth, size))
            .filter(|d| *d < REACH_PX)
            .collect::<Vec<_>>();
        let all = distances(&truth, &to_nearest(&predicted, size))
            .map(|d| d.min(REACH_PX))
            .collect::<Vec<_>>();
        Some(Self {
            accuracy_px: crate::statistics::mean(&near).unwrap_or(REACH_PX),
            completeness_px: crate::statistics::mean(&all)?,
        })
    }
}

/// The distances at the edge pixels.
fn distances<'a>(edges: &'a [bool], distance: &'a [f64]) -> impl Iterator<Item = f64> + 'a {
    edges
        .iter()
        .zip(distance)
        .filter(|(e, _)| **e)
        .map(|(_, d)| *d)
}
