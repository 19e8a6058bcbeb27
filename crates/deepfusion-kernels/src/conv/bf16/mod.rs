//! Convolutions of numbers rounded to bf16, with sums in f32, for the matrix unit (AMX) and the dot products of pairs (AVX512-BF16).
//!
//! Both multiply pairs. In the forward pass and the input gradient, the values of two neighbouring channels are one 32-bit word of the
//! tile's planes, and a step of the product sums a tap over up to sixteen such pairs. In the weight gradient, two neighbouring pixels are a
//! word, and a step sums sixteen of those.

#[cfg(target_arch = "x86_64")]
mod dot;
#[cfg(target_arch = "x86_64")]
mod matrix;
mod pack;
mod pixels;
mod taps;

pub(super) use pack::{pack_weights, planar, zipped};
pub(super) use pixels::PixelPairs;
pub(super) use taps::TapPairs;

use super::ConvShape;

/// Channels must be a multiple of this: the rows of a tile of the matrix unit.
pub(super) const ROWS: usize = 16;
/// Columns must be a multiple of this: two tiles side by side.
pub(super) const COLUMNS: usize = 32;

/// How convolutions multiply and add.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Default)]
#[cfg_attr(
    feature = "schema",
    derive(serde::Serialize, serde::Deserialize, schemars::JsonSchema),
    serde(rename_all = "lowercase")
)]
pub enum Precision {
    /// Everything in f32: the same bits on every processor with fused multiply-add.
    #[default]
    F32,
    /// Images, gradients and weights are rounded to bf16 for multiplication; sums and results are in f32. This applies to convolutions with
    /// a multiple of 16 input and output channels, on processors with AMX or AVX512-BF16 and on GPUs with tensor cores for bf16; the others
    /// stay in f32.
    Bf16,
}

impl Precision {
    /// Whether a convolution with these numbers of channels multiplies in bf16.
    #[must_use]
    pub fn is_bf16_for(self, in_channels: usize, out_channels: usize) -> bool {
        let fits = |channels: usize| channels > 0 && channels.is_multiple_of(ROWS);
        self == Self::Bf16 && fits(in_channels) && fits(out_channels)
    }
}

/// The processor's instructions that multiply pairs of bf16.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[cfg_attr(
    not(target_arch = "x86_64"),
    allow(dead_code, reason = "other processors have neither")
)]
pub(super) enum Unit {
    /// AVX512-BF16.
    Dot,
    /// AMX.
    Matrix,
}

impl Unit {
    /// The unit of this processor; the faster one if it has both.
    #[cfg(target_arch = "x86_64")]
    pub(super) fn found() -> Option<Self> {
        if crate::matrix_unit::available() {
            return Some(Self::Matrix);
        }
        dot::available().then_some(Self::Dot)
    }

    #[cfg(not(target_arch = "x86_64"))]
    pub(super) fn found() -> Option<Self> {
        None
    }

    /// The unit to use for a convolution; `None` for f32.
    pub(super) fn of(shape: &ConvShape) -> Option<Self> {
        let pairs = shape
            .precision
            .is_bf16_for(shape.in_channels, shape.out_channels);
        if pairs { Self::found() } else { None }
    }
}

/// Whether this processor can compute convolutions in [`Precision::Bf16`]: it has AVX512-BF16, or it has AMX and the system allows this
/// process to use it.
#[must_use]
pub fn has_bf16() -> bool {
    Unit::found().is_some()
}

/// Number of pairs of channels in a step: the largest, up to sixteen, that divides all pairs evenly.
pub(super) fn pairs_of(channels: usize) -> usize {
    let pairs = channels / 2;
    (1..=ROWS)
        .rev()
        .find(|n| pairs.is_multiple_of(*n))
        .unwrap_or(1)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::noise::noise32 as noise;

    fn value(half: u32) -> f64 {
        f64::from(f32::from_bits(half << 16))
    }

    /// The sum of both products of two words.
    fn dot(a: u32, b: u32) -> f64 {
        value(a & 0xffff) * value(b & 0xffff) + value(a >> 16) * value(b >> 16)
    }

    fn words(len: usize, seed: u64) -> Vec<u32> {
        let (a, b) = (noise(len, seed), noise(len, seed + 1));
        let mut words = vec![0; len];
        zipped(&a, &b, &mut words);
        words
    }

    fn units() -> Vec<Unit> {
        #[cfg_attr(
            not(target_arch = "x86_64"),
            expect(unused_mut, reason = "nothing is added")
        )]
        let mut units = Vec::new();
        #[cfg(target_arch = "x86_64")]
        {
            units.extend(dot::available().then_some(Unit::Dot));
            units.extend(crate::matrix_unit::available().then_some(Unit::Matrix));
        }
        units
    }

    fn assert_close(ours: &[f32], exact: &[f64], what: &str) {
        for (i, (a, b)) in ours.iter().zip(exact).enumerate() {
            let far = (f64::from(*a) - b).abs();
            assert!(far < 2e-5 * (1.0 + b.abs()), "{what}[{i}]: {a}, not {b}");
        }
    }

    /// All shapes of blocks, several rounds of sums, steps of eight and of sixteen pairs; with both units if the processor has them.
    #[test]
    fn products_over_taps_equal_their_definition() {
        for (rows, pairs, steps) in [(16, 8, 3), (48, 16, 19), (64, 10, 40)] {
            let (columns, plane_len) = (96, 150);
            let source = words(2 * pairs * plane_len, 1);
            let weights = words(rows * steps * pairs, 3);
            let offsets: Vec<usize> = (0..steps).map(|k| k * 7 % 50).collect();
            let mut exact = vec![0.0; rows * columns];
            for (at, sum) in exact.iter_mut().enumerate() {
                let (m, q) = (at / columns, at % columns);
                for (step, offset) in offsets.iter().enumerate() {
                    for p in 0..pairs {
                        let tile = (m / ROWS * steps + step) * ROWS + m % ROWS;
                        let weight = weights[tile * pairs + p];
                        *sum += dot(weight, source[offset + p * plane_len + q]);
                    }
                }
            }
            for unit in units() {
                let mut out = vec![7.0; rows * columns];
                TapPairs {
                    weights: &weights,
                    offsets: &offsets,
                    pairs,
                    plane_len,
                    source: &source,
                    columns,
                    out: &mut out,
                    rows,
                }
                .run(unit);
                assert_close(&out, &exact, &format!("{unit:?} {rows} {pairs} {steps}"));
            }
        }
    }

    #[test]
    fn products_over_pixels_equal_their_definition() {
        for (channels, outputs, pixels) in
            [(16, 16, 32), (48, 80, 544), (32, 48, 640), (64, 32, 96)]
        {
            let (plane_len, offsets) = (pixels + 9, [0, 5, 3]);
            let mut source = vec![0; channels * plane_len];
            planar(&noise(channels * plane_len, 5), &mut source);
            let grad = words(pixels / 2 * outputs, 7);
            let start = noise(channels * offsets.len() * outputs, 9);
            let mut exact: Vec<f64> = start.iter().map(|v| f64::from(*v)).collect();
            for (at, sum) in exact.iter_mut().enumerate() {
                let (row, o) = (at / outputs, at % outputs);
                let (c, t) = (row / offsets.len(), row % offsets.len());
                for i in 0..pixels / 2 {
                    let from = c * plane_len + offsets[t] + 2 * i;
                    let pair = u32::from(source[from]) | u32::from(source[from + 1]) << 16;
                    *sum += dot(pair, grad[i * outputs + o]);
                }
            }
            for unit in units() {
                let mut out = start.clone();
                PixelPairs {
                    offsets: &offsets,
                    plane_len,
                    channels,
                    source: &source,
                    pixels,
                    grad: &grad,
                    outputs,
                    out: &mut out,
                }
                .run(unit);
                assert_close(
                    &out,
                    &exact,
                    &format!("{unit:?} {channels} {outputs} {pixels}"),
                );
            }
        }
    }

    #[test]
    fn all_channels_are_in_steps_of_equal_length() {
        for (channels, pairs) in [
            (16, 8),
            (32, 16),
            (48, 12),
            (80, 10),
            (96, 16),
            (112, 14),
            (512, 16),
        ] {
            assert_eq!(pairs_of(channels), pairs, "{channels}");
        }
    }
}
