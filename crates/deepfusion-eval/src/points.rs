use nalgebra::Vector3;
use serde::{Deserialize, Serialize};

use deepfusion_geometry::Intrinsics;

use crate::statistics::{mean, standard_deviation};

/// A point drawn at random among the compared pixels, in the camera frame (x right, y down, z forward), in metres.
///
/// All three positions lie on the ray through the pixel's centre, because the ground truth is known only as a depth per pixel. Where in the
/// pixel the LiDAR's beam hit is not stored (half a pixel is 0.06 m at 80 m with KITTI's camera). Predictions are clamped to the protocol's
/// range, as for the metrics. Without a camera, x and y are 0.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct DrawnPoint {
    /// Index of the image, in the order they were added.
    pub image: usize,
    /// The pixel's column and row.
    pub pixel: [usize; 2],
    /// True position.
    pub truth: [f64; 3],
    /// Predicted position.
    pub predicted: [f64; 3],
    /// Predicted position after the image's depth was multiplied by median(gt) / median(prediction).
    pub median_scaled: [f64; 3],
}

impl DrawnPoint {
    /// The point at pixel (`u`, `v`), from depths in metres: P = D·K⁻¹·(u, v, 1)ᵀ (the paper's Eq. 3).
    pub(crate) fn new(
        image: usize,
        camera: Option<&Intrinsics>,
        (u, v): (usize, usize),
        [truth, predicted, median_scaled]: [f64; 3],
    ) -> Self {
        let place = |depth: f64| match camera {
            Some(k) => k.back_project(u as f64, v as f64, depth).into(),
            None => [0.0, 0.0, depth],
        };
        Self {
            image,
            pixel: [u, v],
            truth: place(truth),
            predicted: place(predicted),
            median_scaled: place(median_scaled),
        }
    }

    /// Euclidean distance between the predicted and the true position, in metres.
    #[must_use]
    pub fn distance_m(&self) -> f64 {
        distance(&self.predicted, &self.truth)
    }

    /// The same distance after median scaling.
    #[must_use]
    pub fn median_scaled_distance_m(&self) -> f64 {
        distance(&self.median_scaled, &self.truth)
    }
}

fn distance(a: &[f64; 3], b: &[f64; 3]) -> f64 {
    (Vector3::from(*a) - Vector3::from(*b)).norm()
}

/// Distances in metres between the predicted and true positions of drawn points (the paper's Fig. 11).
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
pub struct PointErrors {
    /// Number of points.
    pub n: usize,
    /// Mean distance; `None` without points.
    pub mean_m: Option<f64>,
    /// Standard deviation (n − 1); `None` for fewer than two points.
    pub std_m: Option<f64>,
    /// Standard error of the mean, `std_m` / √n, as if the points were independent; `None` for fewer than two points.
    pub sem_m: Option<f64>,
    /// Standard error with images as the independent units, since the errors within an image are correlated: √(G/(G−1) Σ_g (Σ_{i∈g} (d_i −
    /// mean))²) / n over G images. `None` for fewer than two images.
    #[serde(default)]
    pub sem_images_m: Option<f64>,
}

impl PointErrors {
    /// The statistics of distances, each with the index of its image.
    #[must_use]
    pub fn of(distances: &[(usize, f64)]) -> Self {
        let values: Vec<f64> = distances.iter().map(|(_, d)| *d).collect();
        let n = values.len();
        let mean_m = mean(&values);
        let std_m = standard_deviation(&values, 1);
        Self {
            n,
            mean_m,
            std_m,
            sem_m: std_m.map(|s| s / (n as f64).sqrt()),
            sem_images_m: mean_m.and_then(|mean| error_by_image(distances, mean)),
        }
    }
}

fn error_by_image(distances: &[(usize, f64)], mean: f64) -> Option<f64> {
    let mut sums = std::collections::BTreeMap::<usize, f64>::new();
    for (image, distance) in distances {
        *sums.entry(*image).or_default() += distance - mean;
    }
    let images = sums.len() as f64;
    (sums.len() > 1).then(|| {
        let squares: f64 = sums.values().map(|s| s * s).sum();
        (images / (images - 1.0) * squares).sqrt() / distances.len() as f64
    })
}

/// Point statistics for true depths in [`from_m`, `to_m`).
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct PointRange {
    /// Lower limit of the true depth, in metres.
    pub from_m: u32,
    /// Upper limit of the true depth, in metres.
    pub to_m: u32,
    /// Statistics of the unchanged predictions.
    #[serde(flatten)]
    pub unscaled: PointErrors,
    /// Statistics after median scaling.
    pub median_scaled: PointErrors,
}

/// Results of the drawn points (the paper's Fig. 10–11 and Table 2). Points are drawn uniformly from all compared pixels, so each range
/// contains them in proportion to its ground truth.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Points {
    /// Statistics of the unchanged predictions.
    #[serde(flatten)]
    pub unscaled: PointErrors,
    /// Statistics after each image's depth was multiplied by median(gt) / median(prediction).
    #[serde(default)]
    pub median_scaled: PointErrors,
    /// Whether all cameras were known, so that distances are in space; otherwise they are along z.
    #[serde(default)]
    pub in_space: bool,
    /// The seed of the random draw.
    #[serde(default)]
    pub seed: u64,
    /// Statistics by true depth.
    #[serde(default)]
    pub ranges: Vec<PointRange>,
}

impl Points {
    /// Statistics of drawn points; `edges_m` are the limits of the depth ranges. `None` without points.
    pub(crate) fn of(
        points: &[DrawnPoint],
        edges_m: &[u32],
        in_space: bool,
        seed: u64,
    ) -> Option<Self> {
        let both = |wanted: &dyn Fn(&DrawnPoint) -> bool| {
            let inside = || points.iter().filter(|p| wanted(p));
            let unscaled: Vec<_> = inside().map(|p| (p.image, p.distance_m())).collect();
            let scaled: Vec<_> = inside()
                .map(|p| (p.image, p.median_scaled_distance_m()))
                .collect();
            (PointErrors::of(&unscaled), PointErrors::of(&scaled))
        };
        let (unscaled, median_scaled) = both(&|_| true);
        let range = |edges: &[u32]| {
            let inside = |p: &DrawnPoint| {
                p.truth[2] >= f64::from(edges[0]) && p.truth[2] < f64::from(edges[1])
            };
            let (unscaled, median_scaled) = both(&inside);
            PointRange {
                from_m: edges[0],
                to_m: edges[1],
                unscaled,
                median_scaled,
            }
        };
        (!points.is_empty()).then(|| Self {
            unscaled,
            median_scaled,
            in_space,
            seed,
            ranges: edges_m.windows(2).map(range).collect(),
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use approx::assert_relative_eq;

    #[test]
    fn two_images_by_hand() {
        let errors = PointErrors::of(&[(0, 1.0), (0, 3.0), (1, 5.0), (1, 7.0)]);
        assert_eq!((errors.n, errors.mean_m), (4, Some(4.0)));
        assert_relative_eq!(errors.std_m.unwrap(), (20.0f64 / 3.0).sqrt());
        assert_relative_eq!(errors.sem_m.unwrap(), (20.0f64 / 3.0).sqrt() / 2.0);
        // Both images are off by 2 on average: sums −4 and 4, √(2 · 32) / 4.
        assert_relative_eq!(errors.sem_images_m.unwrap(), 2.0);
    }

    #[test]
    fn one_point_has_no_spread_and_none_no_mean() {
        let one = PointErrors::of(&[(3, 0.5)]);
        assert_eq!(one.mean_m, Some(0.5));
        assert_eq!((one.std_m, one.sem_m, one.sem_images_m), (None, None, None));
        assert_eq!(PointErrors::of(&[]), PointErrors::default());
        assert_eq!(Points::of(&[], &[0, 10], true, 0), None);
    }

    #[test]
    fn a_point_lies_on_its_pixels_ray() {
        let k = Intrinsics {
            fx: 100.0,
            fy: 50.0,
            cx: 10.0,
            cy: 5.0,
            width: 20,
            height: 10,
        };
        let point = DrawnPoint::new(0, Some(&k), (20, 10), [10.0, 12.5, 10.0]);
        assert_eq!(point.truth, [1.0, 1.0, 10.0]);
        assert_eq!(point.predicted, [1.25, 1.25, 12.5]);
        assert_relative_eq!(point.distance_m(), 0.25 * 102.0f64.sqrt(), epsilon = 1e-12);
        assert_eq!(point.median_scaled_distance_m(), 0.0);
    }
}
