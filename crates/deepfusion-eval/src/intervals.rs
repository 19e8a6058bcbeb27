//! Intervals around a depth, from a network's own uncertainty, and whether they contain the truth as often as promised.
//!
//! A network that predicts the error b of ln D̂ promises the interval D̂·exp(±q·b). For a Laplace distribution q = −ln(1 − level).
//! Predicted uncertainty is seldom that exact, so q is found on drives that training has not seen (split conformal prediction, separately
//! for each range of depths), and its coverage is measured on other drives.

use serde::{Deserialize, Serialize};

use crate::error::ENDS_M;
use crate::{Error, IntervalsProblem, LEVELS, Result};

/// A range with fewer pixels than this gets the factors of all ranges together.
const FEWEST: usize = 200;

/// A pixel with known depth.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct IntervalSample {
    /// Predicted depth D̂, in metres.
    pub depth_m: f64,
    /// b, as predicted by the network.
    pub scale: f64,
    /// |ln D̂ − ln D|.
    pub error: f64,
    /// Index of the drive.
    pub drive: usize,
}

impl IntervalSample {
    fn score(&self) -> f64 {
        self.error / self.scale
    }
}

/// The interval factors q of a network.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct IntervalFactors {
    /// The levels that the factors are for: [`LEVELS`].
    pub levels: [f64; 3],
    /// Factors by range of predicted depth, near to far.
    pub ranges: Vec<FactorRange>,
    /// Number of drives they were found on.
    pub drives: usize,
    /// Number of pixels they were found on.
    pub pixels: usize,
}

/// The factors for one range of predicted depths.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct FactorRange {
    /// The range's far end, in metres; absent for the last range.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub to_m: Option<f64>,
    /// q for each level.
    pub factors: [f64; 3],
    /// Number of pixels in the range.
    pub pixels: usize,
}

/// Index of the range that a predicted depth belongs to.
fn range_of(depth_m: f64) -> usize {
    ENDS_M.partition_point(|end| depth_m >= *end)
}

fn ends() -> impl Iterator<Item = Option<f64>> {
    ENDS_M.into_iter().map(Some).chain([None])
}

/// The smallest score that a share `level` of the drives' pixels does not exceed, with equal weight for every drive. For one drive with n
/// pixels this is the ⌈(n + 1)·level⌉-th smallest score, or the largest one if n is too small.
fn conformal(samples: &[&IntervalSample], level: f64) -> f64 {
    let mut counts = std::collections::BTreeMap::<usize, usize>::new();
    for sample in samples {
        *counts.entry(sample.drive).or_default() += 1;
    }
    let (n, drives) = (samples.len() as f64, counts.len() as f64);
    let mut scores: Vec<(f64, f64)> = samples
        .iter()
        .map(|sample| (sample.score(), n / (drives * counts[&sample.drive] as f64)))
        .collect();
    scores.sort_by(|a, b| a.0.total_cmp(&b.0));
    let wanted = (n + 1.0) * level;
    let mut sum = 0.0;
    for (score, weight) in &scores {
        sum += weight;
        // The weights of many drives do not add up exactly to whole numbers.
        if sum >= wanted - 1e-9 * n {
            return *score;
        }
    }
    scores.last().map_or(0.0, |(score, _)| *score)
}

impl IntervalFactors {
    /// The factors of a Laplace distribution: the network's uncertainty is taken as it is.
    #[must_use]
    pub fn uncalibrated() -> Self {
        let factors = LEVELS.map(|level| -(1.0 - level).ln());
        Self {
            levels: LEVELS,
            ranges: ends()
                .map(|to_m| FactorRange {
                    to_m,
                    factors,
                    pixels: 0,
                })
                .collect(),
            drives: 0,
            pixels: 0,
        }
    }

    /// Finds the factors on drives that training has not seen; `None` without any pixel.
    #[must_use]
    pub fn calibrate(samples: &[IntervalSample]) -> Option<Self> {
        let all: Vec<&IntervalSample> = samples.iter().filter(|s| s.score().is_finite()).collect();
        if all.is_empty() {
            return None;
        }
        let together = LEVELS.map(|level| conformal(&all, level));
        let ranges = ends().enumerate().map(|(range, to_m)| {
            let of_range = all.iter().copied().filter(|s| range_of(s.depth_m) == range);
            let own: Vec<&IntervalSample> = of_range.collect();
            FactorRange {
                to_m,
                factors: if own.len() < FEWEST {
                    together
                } else {
                    LEVELS.map(|level| conformal(&own, level))
                },
                pixels: own.len(),
            }
        });
        let mut drives: Vec<usize> = all.iter().map(|s| s.drive).collect();
        drives.sort_unstable();
        drives.dedup();
        Some(Self {
            levels: LEVELS,
            ranges: ranges.collect(),
            drives: drives.len(),
            pixels: all.len(),
        })
    }

    /// Whether the factors were found on data.
    #[must_use]
    pub fn is_calibrated(&self) -> bool {
        self.pixels > 0
    }

    /// Checks factors read from a file.
    ///
    /// # Errors
    /// [`Error::Intervals`] for levels or ranges other than this version's, or for factors that are negative or not finite.
    pub fn validate(&self) -> Result<()> {
        let fail = |reason| Err(Error::Intervals { reason });
        if self.levels != LEVELS {
            return fail(IntervalsProblem::Levels { found: self.levels });
        }
        if !self.ranges.iter().map(|r| r.to_m).eq(ends()) {
            return fail(IntervalsProblem::Ranges);
        }
        let mut factors = self.ranges.iter().flat_map(|r| r.factors);
        match factors.find(|q| !(q.is_finite() && *q >= 0.0)) {
            Some(factor) => fail(IntervalsProblem::Factor { factor }),
            None => Ok(()),
        }
    }

    /// The factors q for a predicted depth, one per level.
    #[must_use]
    pub fn at(&self, depth_m: f64) -> [f64; 3] {
        let range = range_of(depth_m).min(self.ranges.len().saturating_sub(1));
        self.ranges.get(range).map_or([0.0; 3], |r| r.factors)
    }

    /// How much wider the 80 % interval of a predicted depth is than the network's own (below 1: narrower).
    #[must_use]
    pub fn stretch(&self, depth_m: f64) -> f64 {
        self.at(depth_m)[1] / -(1.0 - LEVELS[1]).ln()
    }

    /// Coverage and width of the intervals on these pixels, with equal weight for every drive; `None` without any pixel.
    #[must_use]
    pub fn measure(&self, samples: &[IntervalSample]) -> Option<Intervals> {
        let of = |samples: &[&IntervalSample]| -> Vec<IntervalRow> {
            let levels = LEVELS.into_iter().enumerate();
            levels
                .map(|(i, level)| {
                    let mut drives = std::collections::BTreeMap::<usize, [f64; 3]>::new();
                    for sample in samples {
                        let q = self.at(sample.depth_m)[i];
                        let reach = q * sample.scale;
                        let sums = drives.entry(sample.drive).or_default();
                        sums[0] += 1.0;
                        sums[1] += f64::from(u8::from(sample.error <= reach));
                        sums[2] += reach.exp() - (-reach).exp();
                    }
                    let mean = |part: usize| {
                        let shares = drives.values().map(|sums| sums[part] / sums[0]);
                        shares.sum::<f64>() / drives.len().max(1) as f64
                    };
                    IntervalRow {
                        level,
                        coverage: mean(1),
                        width_rel: mean(2),
                    }
                })
                .collect()
        };
        let all: Vec<&IntervalSample> = samples.iter().filter(|s| s.score().is_finite()).collect();
        if all.is_empty() {
            return None;
        }
        let mut from_m = 0.0;
        let mut ranges = Vec::new();
        for (range, to_m) in ends().enumerate() {
            let of_range = all.iter().copied().filter(|s| range_of(s.depth_m) == range);
            let own: Vec<&IntervalSample> = of_range.collect();
            if !own.is_empty() {
                ranges.push(IntervalRange {
                    from_m,
                    to_m,
                    n: own.len(),
                    levels: of(&own),
                });
            }
            from_m = to_m.unwrap_or(from_m);
        }
        Some(Intervals {
            calibrated: self.is_calibrated(),
            in_sample: false,
            n: all.len(),
            levels: of(&all),
            ranges,
        })
    }
}

/// Coverage and width of a network's intervals.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Intervals {
    /// Whether the network's uncertainty was calibrated on held-out drives first.
    pub calibrated: bool,
    /// Whether it was calibrated on these very pixels. Then the coverage is right by construction and proves nothing.
    #[serde(default, skip_serializing_if = "std::ops::Not::not")]
    pub in_sample: bool,
    /// Number of pixels.
    pub n: usize,
    /// Results for each level.
    pub levels: Vec<IntervalRow>,
    /// Results by range of predicted depth.
    pub ranges: Vec<IntervalRange>,
}

/// Coverage and width of the intervals of one level.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct IntervalRow {
    /// The share of pixels that the intervals should contain.
    pub level: f64,
    /// The share of pixels whose true depth is inside; the mean over drives.
    pub coverage: f64,
    /// Mean of the interval's width divided by the predicted depth.
    pub width_rel: f64,
}

/// Results for one range of predicted depths.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct IntervalRange {
    /// Near end of the range, in metres.
    pub from_m: f64,
    /// Far end of the range, in metres; absent for the last range.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub to_m: Option<f64>,
    /// Number of pixels.
    pub n: usize,
    /// Results for each level.
    pub levels: Vec<IntervalRow>,
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Quantiles of a Laplace distribution with scale `true_scale` as errors, from a network that predicts the scale `predicted_scale`.
    fn samples(
        n: usize,
        true_scale: f64,
        predicted_scale: f64,
        depth_m: f64,
        drive: usize,
    ) -> Vec<IntervalSample> {
        (0..n)
            .map(|i| IntervalSample {
                depth_m,
                scale: predicted_scale,
                error: -true_scale * (1.0 - (i as f64 + 0.5) / n as f64).ln(),
                drive,
            })
            .collect()
    }

    #[test]
    fn one_drive_gives_the_conformal_quantile() {
        let scores = [0.3, 0.1, 0.9, 0.5, 0.7, 0.2, 0.4, 0.8, 0.6];
        let drive: Vec<IntervalSample> = scores
            .iter()
            .map(|score| IntervalSample {
                depth_m: 5.0,
                scale: 0.5,
                error: 0.5 * score,
                drive: 3,
            })
            .collect();
        let all: Vec<&IntervalSample> = drive.iter().collect();
        // ⌈(9 + 1)·level⌉-th smallest: the 5th, the 8th, and the 10th does not exist.
        for (level, expected) in [(0.5, 0.5), (0.8, 0.8), (0.95, 0.9), (0.41, 0.5)] {
            assert_eq!(conformal(&all, level), expected, "{level}");
        }
    }

    #[test]
    fn a_well_calibrated_network_needs_no_correction() {
        let drive = samples(20_000, 0.2, 0.2, 15.0, 0);
        let uncalibrated = IntervalFactors::uncalibrated();
        let measured = uncalibrated.measure(&drive).unwrap();
        assert!(!measured.calibrated);
        let found = IntervalFactors::calibrate(&drive).unwrap();
        for (i, row) in measured.levels.iter().enumerate() {
            assert!((row.coverage - row.level).abs() < 1e-3, "{row:?}");
            assert!((found.at(15.0)[i] / uncalibrated.at(15.0)[i] - 1.0).abs() < 2e-3);
        }
        assert!((found.stretch(15.0) - 1.0).abs() < 2e-3);
        // Half of all errors are below b·ln 2: the interval's relative width is 2·sinh(b·ln 2).
        let width = 2.0 * (0.2 * 2f64.ln()).sinh();
        assert!((measured.levels[0].width_rel - width).abs() < 1e-9);
    }

    /// Overconfident near, underconfident far: each range is corrected separately, and other drives of the same kind are covered.
    #[test]
    fn ranges_are_corrected_separately_and_drives_weigh_equally() {
        let drive = |number| {
            let mut all = samples(4_000, 0.2, 0.1, 5.0, number);
            all.extend(samples(2_000, 0.1, 0.3, 30.0, number));
            all
        };
        let mut learned = drive(0);
        learned.extend(drive(1));
        let factors = IntervalFactors::calibrate(&learned).unwrap();
        factors.validate().unwrap();
        assert_eq!((factors.drives, factors.pixels), (2, 12_000));
        assert!((factors.stretch(5.0) - 2.0).abs() < 0.01);
        assert!((factors.stretch(30.0) - 1.0 / 3.0).abs() < 0.01);
        let measured = factors.measure(&drive(7)).unwrap();
        assert!(measured.calibrated);
        assert_eq!(measured.ranges.len(), 2);
        for row in measured.ranges.iter().flat_map(|r| &r.levels) {
            assert!((row.coverage - row.level).abs() < 2e-3, "{row:?}");
        }
        // A long drive with twice the errors has the same weight as a short one.
        let mut uneven = samples(9_000, 0.2, 0.1, 5.0, 0);
        uneven.extend(samples(500, 0.1, 0.1, 5.0, 1));
        let measured = IntervalFactors::uncalibrated().measure(&uneven).unwrap();
        let expected = 0.5 * (1.0 - 0.5f64.powf(0.5) + 0.5);
        assert!((measured.levels[0].coverage - expected).abs() < 5e-3);
    }

    /// The key is written only if it is true; older files lack it.
    #[test]
    fn calibration_on_the_same_pixels_is_marked() {
        let drive = samples(500, 0.2, 0.1, 5.0, 0);
        let factors = IntervalFactors::calibrate(&drive).unwrap();
        let mut measured = factors.measure(&drive).unwrap();
        for in_sample in [false, true] {
            measured.in_sample = in_sample;
            let text = serde_json::to_string(&measured).unwrap();
            assert_eq!(text.contains("\"in_sample\":true"), in_sample);
            assert_eq!(text.contains("in_sample"), in_sample);
            let read: Intervals = serde_json::from_str(&text).unwrap();
            assert_eq!(read.in_sample, in_sample);
        }
    }

    #[test]
    fn factors_from_a_file_are_validated() {
        let right = IntervalFactors::uncalibrated();
        let mut wrong = right.clone();
        wrong.ranges.pop();
        assert!(wrong.validate().is_err());
        let mut wrong = right.clone();
        wrong.levels[1] = 0.9;
        assert!(wrong.validate().is_err());
        let mut wrong = right.clone();
        wrong.ranges[2].factors[0] = f64::NAN;
        let error = wrong.validate().unwrap_err();
        assert!(error.to_string().contains("NaN"), "{error}");
        assert!(right.validate().is_ok());
        assert_eq!(IntervalFactors::calibrate(&[]), None);
        assert_eq!(right.measure(&[]), None);
    }
}
