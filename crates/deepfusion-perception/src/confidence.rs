//! How far a predicted depth can be trusted, pixel by pixel: exp(−expected relative error).
//!
//! Two things indicate an error without ground truth: the disparity's local gradient (edges bleed), and a different
//! prediction for the mirrored image. Their weights are fitted on pixels with ground truth.

use nalgebra::{Matrix3, Vector3};
use serde::{Deserialize, Serialize};

/// Indicators of an error at one pixel.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct Evidence {
    /// Largest difference between the disparity and that of an adjacent pixel, divided by the disparity.
    pub gradient: f32,
    /// Difference between the disparity and that of the mirrored image, divided by their mean; 0 if that was not computed.
    pub flip: f32,
}

impl Evidence {
    /// Computes the evidence for every pixel of a disparity image, row by row; `mirrored` is the mirrored image's disparity, mirrored back.
    #[must_use]
    pub fn of(disparity: &[f32], mirrored: Option<&[f32]>, width: usize) -> Vec<Self> {
        let width = width.max(1);
        let height = disparity.len() / width;
        let mut all = Vec::with_capacity(disparity.len());
        for v in 0..height {
            for u in 0..width {
                let i = v * width + u;
                let d = disparity[i];
                let beside = [
                    disparity[v * width + u.saturating_sub(1)],
                    disparity[v * width + (u + 1).min(width - 1)],
                    disparity[v.saturating_sub(1) * width + u],
                    disparity[(v + 1).min(height - 1) * width + u],
                ];
                let steepest = beside.iter().map(|b| (b - d).abs()).fold(0.0, f32::max);
                let flip = mirrored.map_or(0.0, |m| 2.0 * (m[i] - d).abs() / (m[i] + d));
                let usable = |x: f32| {
                    if x.is_finite() {
                        x.clamp(0.0, 2.0)
                    } else {
                        2.0
                    }
                };
                all.push(Self {
                    gradient: usable(steepest / d),
                    flip: usable(flip),
                });
            }
        }
        all
    }
}

/// Expected relative error of a depth: constant + gradient·(gradient of the disparity) + flip·(disagreement with the mirrored image).
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ConfidenceModel {
    /// The constant part of the error.
    pub constant: f64,
    /// Weight of [`Evidence::gradient`].
    pub gradient: f64,
    /// Weight of [`Evidence::flip`].
    pub flip: f64,
}

/// Largest relative error that is used, so that a single pixel beside a pole does not dominate.
pub const MOST_ERROR: f64 = 1.0;

impl ConfidenceModel {
    /// The expected relative error for this evidence.
    #[must_use]
    pub fn expected_error(&self, evidence: &Evidence) -> f64 {
        self.constant
            + self.gradient * f64::from(evidence.gradient)
            + self.flip * f64::from(evidence.flip)
    }

    /// exp(−expected relative error): 1 for a depth without error, 0.9 for one that is expected to be 10 % off.
    #[must_use]
    pub fn confidence(&self, evidence: &Evidence) -> f64 {
        (-self.expected_error(evidence)).exp()
    }

    /// Fits the errors (capped at [`MOST_ERROR`]) to the evidence by least squares without negative weights, so that more evidence never
    /// means a smaller error. `None` without any sample.
    #[must_use]
    pub fn fit(samples: &[(Evidence, f64)]) -> Option<Self> {
        let mut normal = Matrix3::<f64>::zeros();
        let mut right = Vector3::<f64>::zeros();
        let mut squares = 0.0;
        for (evidence, error) in samples.iter().filter(|(_, error)| error.is_finite()) {
            let x = Vector3::new(1.0, f64::from(evidence.gradient), f64::from(evidence.flip));
            let error = error.min(MOST_ERROR);
            normal += x * x.transpose();
            right += x * error;
            squares += error * error;
        }
        if normal[(0, 0)] < 1.0 {
            return None;
        }
        // Non-negative least squares: tries every subset of the three weights as the non-zero ones.
        let mut best: Option<(f64, Vector3<f64>)> = None;
        for choice in 1..8u32 {
            let used = |i: usize| choice & (1 << i) != 0;
            let part = Matrix3::from_fn(|i, j| match (used(i) && used(j), i == j) {
                (true, _) => normal[(i, j)],
                (false, same) => f64::from(same),
            });
            let Some(inverse) = part.try_inverse() else {
                continue;
            };
            let weights = inverse * Vector3::from_fn(|i, _| if used(i) { right[i] } else { 0.0 });
            if weights.iter().any(|w| *w < 0.0 || !w.is_finite()) {
                continue;
            }
            let cost = squares - 2.0 * weights.dot(&right) + (normal * weights).dot(&weights);
            if best.is_none_or(|(least, _)| cost < least) {
                best = Some((cost, weights));
            }
        }
        best.map(|(_, w)| Self {
            constant: w.x,
            gradient: w.y,
            flip: w.z,
        })
    }

    /// Divides the samples into `bins` parts of equal size, from the least to the most trusted: mean confidence, expected and observed
    /// error, and number of samples in each.
    #[must_use]
    pub fn reliability(&self, samples: &[(Evidence, f64)], bins: usize) -> Vec<Reliability> {
        let mut pairs: Vec<(f64, f64)> = samples
            .iter()
            .filter(|(_, error)| error.is_finite())
            .map(|(evidence, error)| (self.expected_error(evidence), error.min(MOST_ERROR)))
            .collect();
        pairs.sort_by(|a, b| b.0.total_cmp(&a.0));
        let size = pairs.len().div_ceil(bins.max(1)).max(1);
        pairs
            .chunks(size)
            .map(|part| {
                let n = part.len();
                let mean = |value: &dyn Fn(&(f64, f64)) -> f64| {
                    part.iter().map(value).sum::<f64>() / n as f64
                };
                Reliability {
                    confidence: mean(&|s| (-s.0).exp()),
                    expected: mean(&|s| s.0),
                    observed: mean(&|s| s.1),
                    n,
                }
            })
            .collect()
    }
}

/// Expected and observed error of one bin of confidence.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Reliability {
    /// Mean confidence.
    pub confidence: f64,
    /// Mean expected relative error.
    pub expected: f64,
    /// Mean observed relative error.
    pub observed: f64,
    /// Number of pixels.
    pub n: usize,
}

#[cfg(test)]
mod tests {
    use super::*;

    fn evidence(i: usize) -> Evidence {
        Evidence {
            gradient: (i * 7 % 13) as f32 * 0.02,
            flip: (i * 5 % 11) as f32 * 0.03,
        }
    }

    #[test]
    fn the_fit_recovers_the_weights_of_the_errors() {
        let truth = ConfidenceModel {
            constant: 0.05,
            gradient: 1.5,
            flip: 0.4,
        };
        // A pattern of deviations from the expectation, with mean 0.
        let samples: Vec<_> = (0..14_300)
            .map(|i| {
                let e = evidence(i);
                (
                    e,
                    truth.expected_error(&e) + if i % 2 == 0 { 0.02 } else { -0.02 },
                )
            })
            .collect();
        let found = ConfidenceModel::fit(&samples).unwrap();
        assert!((found.constant - truth.constant).abs() < 2e-3, "{found:?}");
        assert!((found.gradient - truth.gradient).abs() < 1e-2, "{found:?}");
        assert!((found.flip - truth.flip).abs() < 1e-2, "{found:?}");
        let bins = found.reliability(&samples, 5);
        assert_eq!(bins.iter().map(|b| b.n).sum::<usize>(), samples.len());
        assert!(bins.windows(2).all(|b| b[0].confidence < b[1].confidence));
        assert!(
            bins.iter().all(|b| (b.expected - b.observed).abs() < 0.01),
            "{bins:?}"
        );
    }

    #[test]
    fn evidence_that_lowers_the_error_gets_no_weight() {
        let samples: Vec<_> = (0..1000)
            .map(|i| {
                let e = evidence(i);
                (e, 0.3 - 0.5 * f64::from(e.gradient) + f64::from(e.flip))
            })
            .collect();
        let found = ConfidenceModel::fit(&samples).unwrap();
        assert_eq!(found.gradient, 0.0);
        assert!(found.flip > 0.8 && found.constant > 0.2, "{found:?}");
        assert_eq!(ConfidenceModel::fit(&[]), None);
        assert_eq!(ConfidenceModel::fit(&[(evidence(1), f64::NAN)]), None);
    }

    #[test]
    fn edges_and_disagreement_are_seen_and_rubbish_is_the_worst() {
        let disparity = [0.1, 0.1, 0.4, 0.4, f32::NAN, 0.0];
        let mirrored = [0.1, 0.3, 0.4, 0.4, 0.1, 0.0];
        let all = Evidence::of(&disparity, Some(&mirrored), 6);
        assert_eq!(all[0], Evidence::default());
        assert!(
            (all[1].gradient - 3.0f32.min(2.0)).abs() < 1e-6 && (all[1].flip - 1.0).abs() < 1e-6
        );
        assert!((all[2].gradient - 0.75).abs() < 1e-6 && all[2].flip == 0.0);
        assert_eq!(all[4].gradient, 2.0);
        assert!(Evidence::of(&[], None, 4).is_empty());
    }
}
