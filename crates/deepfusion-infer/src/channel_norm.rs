//! Layer normalisation over each pixel's channels.

use std::ops::Range;

use pulp::{Simd, WithSimd};
use rayon::prelude::*;

use crate::dispatch::dispatch;
use crate::element::Element;
use crate::tile::LANES;
use crate::view::{Shared, View};

/// y = (x − μ) / √(σ² + ε) over the channels at the indices `channels`; the others become 0.
///
/// # Safety
/// The views must be in the arena and must not overlap; they must have the same channels. Nobody else may use `to` or write `from`.
pub(crate) unsafe fn channel_norm<E: Element>(
    arena: Shared<E>,
    from: &View,
    channels: &[Range<usize>],
    epsilon: f32,
    to: &View,
) {
    (0..from.height).into_par_iter().for_each(|y| {
        dispatch(Row {
            arena,
            from,
            channels,
            epsilon,
            to,
            y,
        });
    });
}

struct Row<'a, E> {
    arena: Shared<'a, E>,
    from: &'a View,
    channels: &'a [Range<usize>],
    epsilon: f32,
    to: &'a View,
    y: usize,
}

impl<E: Element> WithSimd for Row<'_, E> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, _: S) {
        let Self {
            arena,
            from,
            channels,
            epsilon,
            to,
            y,
        } = self;
        let count: usize = channels.iter().map(Range::len).sum();
        let share = 1.0 / count as f32;
        let gaps = count < to.channels;
        for x in 0..from.width {
            // SAFETY: a pixel of the view, which nobody writes, and one of `to`, whose row is used by this task only (the contract of
            // `channel_norm`).
            let (pixel, out) = unsafe {
                (
                    arena.read(from.at(x, y), from.channels),
                    arena.write(to.at(x, y), to.channels),
                )
            };
            if gaps {
                out.fill(E::of(0.0));
            }
            let sum_of = |term: &dyn Fn(f32) -> f32| -> f32 { sum(pixel, channels, term) };
            let mean = sum_of(&|v| v) * share;
            let variance = sum_of(&|v| (v - mean) * (v - mean)) * share;
            let scale = 1.0 / (variance + epsilon).sqrt();
            for run in channels {
                let values = pixel[run.clone()].iter();
                for (out, value) in out[run.clone()].iter_mut().zip(values) {
                    *out = E::of((value.value() - mean) * scale);
                }
            }
        }
    }
}

/// Σ term(v) for each lane.
#[inline(always)]
fn sum<E: Element>(pixel: &[E], channels: &[Range<usize>], term: impl Fn(f32) -> f32) -> f32 {
    let mut sums = [0.0_f32; LANES];
    for run in channels {
        let (whole, rest) = pixel[run.clone()].as_chunks::<LANES>();
        for values in whole {
            for (sum, value) in sums.iter_mut().zip(values) {
                *sum += term(value.value());
            }
        }
        for (sum, value) in sums.iter_mut().zip(rest) {
            *sum += term(value.value());
        }
    }
    sums.iter().sum()
}
