//! Ranges of convolutions' inputs, which int8 divides into 255 steps, and how they are determined.

use std::collections::BTreeMap;

use crate::element::Element;
use crate::view::{Shared, View};

/// Why input ranges do not belong to a network.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum RangesProblem {
    /// The graph has no ranges.
    #[error("the network is not calibrated")]
    NotCalibrated,
    /// The name does not belong to a convolution that int8 computes.
    #[error("`{name}` is not a convolution that int8 computes in this network")]
    NoSuchConvolution {
        /// The name.
        name: String,
    },
    /// The two numbers are not a range.
    #[error("{} to {} is not a valid input range of `{name}`", ends[0], ends[1])]
    NoRange {
        /// Name of the convolution.
        name: String,
        /// The two numbers.
        ends: [f32; 2],
    },
}

/// For each convolution, by its name: the ends of its input range, which is divided into steps. Values outside are clamped to the ends.
pub type InputRanges = BTreeMap<String, [f32; 2]>;

/// Histograms of the values that convolutions read, over the images that [`Engine::observe`](crate::Engine::observe) ran on.
#[derive(Debug, Clone, Default)]
pub struct SeenInputs {
    of: BTreeMap<String, Histogram>,
    pub(crate) images: usize,
}

impl SeenInputs {
    /// Number of images.
    #[must_use]
    pub fn images(&self) -> usize {
        self.images
    }

    /// For each convolution, the range with the smallest error of 255 steps: the sum of squares of rounding errors inside and clipping
    /// errors outside. A few values are far larger than all others, and steps wide enough for them would be too coarse for the rest.
    #[must_use]
    pub fn ranges(&self) -> InputRanges {
        let each = self.of.iter();
        each.map(|(name, seen)| (name.clone(), seen.best_range()))
            .collect()
    }

    pub(crate) fn of(&mut self, name: &str) -> &mut Histogram {
        self.of.entry(name.to_owned()).or_default()
    }
}

/// Bits of an f32 that are kept: sign, exponent and the first four of the mantissa.
const KEPT_BITS: u32 = 13;
/// Number of candidates for an end of the range, on each side of 0.
const ENDS: i32 = 64;

/// Counts of values, in sixteen bins for each factor of two.
#[derive(Debug, Clone)]
pub(crate) struct Histogram {
    counts: Vec<u64>,
}

impl Default for Histogram {
    fn default() -> Self {
        Self {
            counts: vec![0; 1 << KEPT_BITS],
        }
    }
}

impl Histogram {
    /// Counts the values of a view.
    ///
    /// # Safety
    /// The view must be in the arena, and nobody may write it during the call.
    pub(crate) unsafe fn add<E: Element>(&mut self, arena: Shared<E>, view: &View) {
        for y in 0..view.height {
            for x in 0..view.width {
                // SAFETY: guaranteed by the caller.
                for value in unsafe { arena.read(view.at(x, y), view.channels) } {
                    self.count(value.value());
                }
            }
        }
    }

    fn count(&mut self, value: f32) {
        if value.is_finite() {
            self.counts[(value.to_bits() >> (32 - KEPT_BITS)) as usize] += 1;
        }
    }

    /// The centres of the bins, with their counts; those next to 0 count as 0.
    fn values(&self) -> Vec<(f64, f64)> {
        let half = 1_u32 << (31 - KEPT_BITS);
        let counted = self.counts.iter().enumerate().filter(|(_, n)| **n > 0);
        let middle = |bin: usize| f32::from_bits(((bin as u32) << (32 - KEPT_BITS)) | half);
        counted
            .map(|(bin, n)| (f64::from(middle(bin)), *n as f64))
            .map(|(value, n)| {
                if value.abs() < 1e-30 {
                    (0.0, n)
                } else {
                    (value, n)
                }
            })
            .collect()
    }

    fn best_range(&self) -> [f32; 2] {
        let values = self.values();
        let ends = values.iter().fold([0.0_f64; 2], |[low, high], (v, _)| {
            [low.min(*v), high.max(*v)]
        });
        let tried = |end: f64| -> Vec<f64> {
            if end == 0.0 {
                return vec![0.0];
            }
            (1..=ENDS)
                .map(|k| end * f64::from(k) / f64::from(ENDS))
                .collect()
        };
        let mut best = (f64::INFINITY, ends);
        for low in tried(ends[0]) {
            for high in tried(ends[1]) {
                let error = rounding_error(&values, [low, high]);
                if error < best.0 {
                    best = (error, [low, high]);
                }
            }
        }
        best.1.map(|end| end as f32)
    }
}

/// Error of the 255 steps of a range, as a sum of squares over the values.
fn rounding_error(values: &[(f64, f64)], [low, high]: [f64; 2]) -> f64 {
    let step = (high - low) / 255.0;
    let rounded = step * step / 12.0;
    let of = |value: f64| match value {
        0.0 => 0.0,
        v if v < low => (low - v).powi(2),
        v if v > high => (v - high).powi(2),
        _ => rounded,
    };
    values.iter().map(|(value, n)| n * of(*value)).sum()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn range_of(values: impl Iterator<Item = f32>) -> [f32; 2] {
        let mut seen = SeenInputs::default();
        let histogram = seen.of("conv");
        values.for_each(|v| histogram.count(v));
        seen.ranges()["conv"]
    }

    #[test]
    fn even_values_keep_their_whole_range() {
        let [low, high] = range_of((0..4000).map(|i| i as f32 * 0.001 - 1.0));
        assert!(
            (low + 1.0).abs() < 0.05 && (high - 3.0).abs() < 0.1,
            "{low} {high}"
        );
    }

    /// With a million values below 1 and a single one of 100, an end c costs (100 − c)² + 10⁶·(c/255)²/12, which is smallest at c = 43.9.
    #[test]
    fn rare_large_values_are_clipped() {
        let many = (0..1_000_000).map(|i| (i % 1000) as f32 * 0.001);
        let [low, high] = range_of(many.chain([100.0]));
        assert!(low == 0.0 && (42.0..46.0).contains(&high), "{low} {high}");
    }

    #[test]
    fn zeros_and_non_finite_values_give_a_range_of_zeros() {
        assert_eq!(range_of([0.0, 0.0].into_iter()), [0.0, 0.0]);
        assert_eq!(range_of([f32::NAN, f32::INFINITY].into_iter()), [0.0, 0.0]);
    }
}
