//! What convolutions read, as ranges that int8 divides into 255 steps, and how they are found.

use std::collections::BTreeMap;

use crate::element::Element;
use crate::view::{Shared, View};

/// Why ranges are not those of a network.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum RangesProblem {
    /// There are none.
    #[error("the network was not calibrated")]
    NotCalibrated,
    /// A name that no convolution has, or none that int8 computes.
    #[error("`{name}` is no convolution of this network that int8 computes")]
    NoSuchConvolution {
        /// The name.
        name: String,
    },
    /// Two numbers that are no range.
    #[error("{} to {} is no range of what `{name}` reads", ends[0], ends[1])]
    NoRange {
        /// The convolution.
        name: String,
        /// The two ends.
        ends: [f32; 2],
    },
}

/// For each convolution, by its name, the ends of the range of its input that is divided into steps; what lies beyond is held at them.
pub type InputRanges = BTreeMap<String, [f32; 2]>;

/// How often convolutions read which values, over the images that [`Engine::observe`](crate::Engine::observe) saw.
#[derive(Debug, Clone, Default)]
pub struct SeenInputs {
    of: BTreeMap<String, Histogram>,
    pub(crate) images: usize,
}

impl SeenInputs {
    /// How many images were seen.
    #[must_use]
    pub fn images(&self) -> usize {
        self.images
    }

    /// For each convolution the range whose 255 steps lose least: the squares of what is rounded within it, and of what is cut off
    /// beyond it, are least in sum. Few values are far greater than all others, and steps as wide as those need would be wide for all.
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

/// Bits of an f32 that stay: sign, exponent and the first four of the mantissa.
const KEPT_BITS: u32 = 13;
/// Ends of ranges that are tried, on each side of 0.
const ENDS: i32 = 64;

/// Counts of values, in sixteen bins from each power of two to the next.
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
    /// The view must lie in the arena, and nobody may write it meanwhile.
    pub(crate) unsafe fn add<E: Element>(&mut self, arena: Shared<E>, view: &View) {
        for y in 0..view.height {
            for x in 0..view.width {
                // SAFETY: the caller's promise.
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

    /// Values in the middle of their bins, with their counts; those next to 0 are 0.
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
                let lost = lost(&values, [low, high]);
                if lost < best.0 {
                    best = (lost, [low, high]);
                }
            }
        }
        best.1.map(|end| end as f32)
    }
}

/// What the 255 steps of a range lose of the values, as a sum of squares.
fn lost(values: &[(f64, f64)], [low, high]: [f64; 2]) -> f64 {
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

    /// Of a million values below 1 and a single one of 100, an end c costs (100 − c)² + 10⁶·(c/255)²/12: least at c = 43.9.
    #[test]
    fn what_is_rare_and_great_is_cut_off() {
        let many = (0..1_000_000).map(|i| (i % 1000) as f32 * 0.001);
        let [low, high] = range_of(many.chain([100.0]));
        assert!(low == 0.0 && (42.0..46.0).contains(&high), "{low} {high}");
    }

    #[test]
    fn nothing_but_zeros_or_what_is_not_finite_is_a_range_of_zeros() {
        assert_eq!(range_of([0.0, 0.0].into_iter()), [0.0, 0.0]);
        assert_eq!(range_of([f32::NAN, f32::INFINITY].into_iter()), [0.0, 0.0]);
    }
}
