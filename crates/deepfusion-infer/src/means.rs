//! Means and maxima: of each channel over the image, and of each pixel over its channels.

use std::ops::Range;

use pulp::{Simd, WithSimd};
use rayon::prelude::*;

use crate::dispatch::dispatch;
use crate::element::Element;
use crate::tile::LANES;
use crate::view::{Shared, View};

/// Channels that a task averages: four vectors, whose sums stay in registers.
const AT_ONCE: usize = 4 * LANES;

/// Computes the mean of every channel.
///
/// # Safety
/// The views must be in the arena and must not overlap. Nobody else may use `to`, which must be one pixel with as many channels as `from`,
/// or write `from`.
pub(crate) unsafe fn global_mean<E: Element>(arena: Shared<E>, from: &View, to: &View) {
    let tasks = from.channels.div_ceil(AT_ONCE);
    (0..tasks).into_par_iter().for_each(|task| {
        let first = task * AT_ONCE;
        dispatch(Mean {
            arena,
            from,
            to,
            channels: first..(first + AT_ONCE).min(from.channels),
        });
    });
}

struct Mean<'a, E> {
    arena: Shared<'a, E>,
    from: &'a View,
    to: &'a View,
    channels: Range<usize>,
}

impl<E: Element> WithSimd for Mean<'_, E> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, _: S) {
        let Self {
            arena,
            from,
            to,
            channels,
        } = self;
        let count = channels.len();
        let mut sums = [0.0_f32; AT_ONCE];
        for y in 0..from.height {
            // Each row is summed separately, so that few small numbers are rounded when added to a large one.
            let mut row = [0.0_f32; AT_ONCE];
            for x in 0..from.width {
                // SAFETY: channels of a pixel of the view, which nobody writes (the contract of `global_mean`).
                let pixel = unsafe { arena.read(from.at(x, y) + channels.start, count) };
                match pixel.as_array::<AT_ONCE>() {
                    // A fixed length compiles to whole vectors.
                    Some(pixel) => add(&mut row, pixel),
                    None => add(&mut row[..count], pixel),
                }
            }
            add(&mut sums, &row);
        }
        let share = 1.0 / from.pixels() as f32;
        // SAFETY: channels of `to`'s pixel, which are used by this task only.
        let out = unsafe { arena.write(to.offset + channels.start, count) };
        for (out, sum) in out.iter_mut().zip(sums) {
            *out = E::of(sum * share);
        }
    }
}

#[inline(always)]
fn add<E: Element>(sums: &mut [f32], values: &[E]) {
    for (sum, value) in sums.iter_mut().zip(values) {
        *sum += value.value();
    }
}

/// Each pixel's mean and maximum over the channels at the indices `channels`.
///
/// # Safety
/// As for [`global_mean`], with two channels in `to`.
pub(crate) unsafe fn channel_extent<E: Element>(
    arena: Shared<E>,
    from: &View,
    channels: &[Range<usize>],
    to: &View,
) {
    (0..from.height).into_par_iter().for_each(|y| {
        dispatch(Extent {
            arena,
            from,
            channels,
            to,
            y,
        });
    });
}

struct Extent<'a, E> {
    arena: Shared<'a, E>,
    from: &'a View,
    channels: &'a [Range<usize>],
    to: &'a View,
    y: usize,
}

impl<E: Element> WithSimd for Extent<'_, E> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, _: S) {
        let Self {
            arena,
            from,
            channels,
            to,
            y,
        } = self;
        let count: usize = channels.iter().map(Range::len).sum();
        let share = 1.0 / count as f32;
        for x in 0..from.width {
            let mut sums = [0.0_f32; LANES];
            let mut most = [f32::NEG_INFINITY; LANES];
            for run in channels {
                // SAFETY: channels of a pixel of the view, which nobody writes (the contract of `channel_extent`).
                let values = unsafe { arena.read(from.at(x, y) + run.start, run.len()) };
                let (whole, rest) = values.as_chunks::<LANES>();
                for values in whole {
                    extend(&mut sums, &mut most, values);
                }
                extend(&mut sums, &mut most, rest);
            }
            let sum: f32 = sums.iter().sum();
            let most = most.into_iter().fold(f32::NEG_INFINITY, greater);
            // SAFETY: a pixel of `to`, whose row is used by this task only.
            let out = unsafe { arena.write(to.at(x, y), 2) };
            out.copy_from_slice(&[E::of(sum * share), E::of(most)]);
        }
    }
}

#[inline(always)]
fn extend<E: Element>(sums: &mut [f32; LANES], most: &mut [f32; LANES], values: &[E]) {
    for ((sum, most), value) in sums.iter_mut().zip(most).zip(values) {
        let value = value.value();
        *sum += value;
        *most = greater(*most, value);
    }
}

/// The greater of two values; NaN if one of them is.
#[inline(always)]
fn greater(most: f32, value: f32) -> f32 {
    if most >= value || most.is_nan() {
        most
    } else {
        value
    }
}
