//! Conversion of f32 to words of two bf16.

use super::super::arithmetic::Weights;
use super::ROWS;
use rayon::prelude::*;

/// The nearest bf16 (ties to even), as the upper half of a word; NaN stays NaN.
#[inline(always)]
fn rounded(value: f32) -> u32 {
    let bits = value.to_bits();
    let nearest = bits.wrapping_add(0x7fff + ((bits >> 16) & 1)) & 0xffff_0000;
    if value.is_nan() {
        bits | 0x0040_0000
    } else {
        nearest
    }
}

/// Two numbers as a word, the first in the lower half.
#[inline(always)]
pub(super) fn pair(first: f32, second: f32) -> u32 {
    (rounded(first) >> 16) | (rounded(second) & 0xffff_0000)
}

/// Values of two rows as words: `to[q] = (first[q], second[q])`.
pub(in super::super) fn zipped(first: &[f32], second: &[f32], to: &mut [u32]) {
    #[cfg(target_arch = "x86_64")]
    if pulp::x86::V4::try_new().is_some() {
        // SAFETY: the processor has the instructions, which are part of V4.
        return unsafe { zipped_wide(first, second, to) };
    }
    zip(first, second, to);
}

#[cfg(target_arch = "x86_64")]
#[target_feature(enable = "avx512f,avx512bw,avx512vl,avx512dq")]
fn zipped_wide(first: &[f32], second: &[f32], to: &mut [u32]) {
    zip(first, second, to);
}

#[inline(always)]
fn zip(first: &[f32], second: &[f32], to: &mut [u32]) {
    for ((to, first), second) in to.iter_mut().zip(first).zip(second) {
        *to = pair(*first, *second);
    }
}

/// A row, rounded.
pub(in super::super) fn planar(from: &[f32], to: &mut [u16]) {
    #[cfg(target_arch = "x86_64")]
    if pulp::x86::V4::try_new().is_some() {
        // SAFETY: the processor has the instructions, which are part of V4.
        return unsafe { planar_wide(from, to) };
    }
    narrow(from, to);
}

#[cfg(target_arch = "x86_64")]
#[target_feature(enable = "avx512f,avx512bw,avx512vl,avx512dq")]
fn planar_wide(from: &[f32], to: &mut [u16]) {
    narrow(from, to);
}

#[inline(always)]
fn narrow(from: &[f32], to: &mut [u16]) {
    for (to, from) in to.iter_mut().zip(from) {
        *to = (rounded(*from) >> 16) as u16;
    }
}

/// Weights as tiles: for every [`ROWS`] rows and each step (a tap of a group of `pairs` pairs of channels), the rows' pairs.
pub(in super::super) fn pack_weights(weights: Weights, pairs: usize, to: &mut [u32]) {
    let Weights {
        values,
        strides: (row_stride, channel_stride),
        channels,
        taps,
        ..
    } = weights;
    let tile = ROWS * pairs;
    let group = taps.len() * tile;
    let block = channels / 2 * taps.len() * ROWS;
    to.par_chunks_mut(block).enumerate().for_each(|(b, to)| {
        for (g, to) in to.chunks_exact_mut(group).enumerate() {
            for row in 0..ROWS {
                let from = &values[(b * ROWS + row) * row_stride..];
                for p in 0..pairs {
                    let channel = 2 * (g * pairs + p);
                    let first = &from[channel * channel_stride..];
                    let second = &from[(channel + 1) * channel_stride..];
                    for (t, tap) in taps.iter().enumerate() {
                        to[t * tile + row * pairs + p] = pair(first[*tap], second[*tap]);
                    }
                }
            }
        }
    });
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_are_rounded_to_the_nearest_and_nan_stays() {
        let value = |bits: u32| f32::from_bits(bits);
        for (from, to) in [
            (1.0, 1.0),
            (value(0x3f80_7fff), 1.0),
            (value(0x3f80_8000), 1.0),
            (value(0x3f81_8000), value(0x3f82_0000)),
            (value(0x3f80_8001), value(0x3f81_0000)),
            (-3.5, -3.5),
            (f32::MAX, f32::INFINITY),
            (f32::NEG_INFINITY, f32::NEG_INFINITY),
        ] {
            assert_eq!(value(rounded(from)), to, "{from}");
        }
        assert!(value(rounded(value(0x7f80_0001))).is_nan());
        let mut words = [0; 2];
        zipped(&[1.0, 2.0], &[-1.0, 0.5], &mut words);
        assert_eq!(words, [0xbf80_3f80, 0x3f00_4000]);
        let mut halves = [0; 2];
        planar(&[1.0, 2.0], &mut halves);
        assert_eq!(halves, [0x3f80, 0x4000]);
    }
}
