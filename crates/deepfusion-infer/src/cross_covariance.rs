//! Cross-covariance attention: channels attend to channels.

use pulp::{Simd, WithSimd};
use rayon::prelude::*;

use crate::dispatch::dispatch;
use crate::element::Element;
use crate::view::{Shared, View};

/// Added to the squared length of a query or a key.
const SQUARED_LENGTH_EPSILON: f32 = 1e-24;

/// The attention of every head, ready to run.
#[derive(Debug)]
pub(crate) struct CrossCovarianceStep {
    /// Queries, keys and values, in this order.
    pub(crate) input: View,
    pub(crate) out: View,
    /// Channels of all heads together.
    pub(crate) channels: usize,
    /// One temperature for each head.
    pub(crate) temperature: Vec<f32>,
}

impl CrossCovarianceStep {
    fn each(&self) -> usize {
        self.channels / self.temperature.len()
    }

    /// Two passes over the image: the similarities of all channels of a head, then the values weighted by them.
    ///
    /// # Safety
    /// The views must be in the arena and must not overlap. Nobody else may use the output or write the input.
    pub(crate) unsafe fn run<E: Element>(&self, arena: Shared<E>) {
        let each = self.each();
        // For each head and value channel: a row of its weights in all of the head's outputs.
        let mut shares = vec![0.0_f32; self.channels * each];
        shares
            .par_chunks_mut(each * each)
            .enumerate()
            .for_each(|(head, shares)| {
                dispatch(Similarities {
                    step: self,
                    arena,
                    head,
                    shares,
                });
            });
        (0..self.out.height).into_par_iter().for_each(|y| {
            dispatch(Mix {
                step: self,
                arena,
                shares: &shares,
                y,
            });
        });
    }
}

/// The attention weights of a head.
struct Similarities<'a, E> {
    step: &'a CrossCovarianceStep,
    arena: Shared<'a, E>,
    head: usize,
    shares: &'a mut [f32],
}

impl<E: Element> WithSimd for Similarities<'_, E> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, _: S) {
        let Self {
            step,
            arena,
            head,
            shares,
        } = self;
        let (each, view) = (step.each(), &step.input);
        let mut row = vec![0.0_f32; each * each];
        let mut lengths = vec![0.0_f32; 2 * each];
        let mut row_lengths = vec![0.0_f32; 2 * each];
        shares.fill(0.0);
        for y in 0..view.height {
            // Each row is summed separately, so that few small numbers are rounded when added to a large one.
            row.fill(0.0);
            row_lengths.fill(0.0);
            for x in 0..view.width {
                let at = view.at(x, y) + head * each;
                // SAFETY: channels of a pixel of the view, which nobody writes (the contract of `run`).
                let (queries, keys) =
                    unsafe { (arena.read(at, each), arena.read(at + step.channels, each)) };
                for (query, sums) in queries.iter().zip(row.chunks_exact_mut(each)) {
                    let query = query.value();
                    for (sum, key) in sums.iter_mut().zip(keys) {
                        *sum += query * key.value();
                    }
                }
                for (sum, value) in row_lengths.iter_mut().zip(queries.iter().chain(keys)) {
                    *sum += value.value() * value.value();
                }
            }
            add(shares, &row);
            add(&mut lengths, &row_lengths);
        }
        let inverse: Vec<f32> = lengths
            .iter()
            .map(|square| 1.0 / (square + SQUARED_LENGTH_EPSILON).sqrt())
            .collect();
        let (of_queries, of_keys) = inverse.split_at(each);
        for (similar, query) in shares.chunks_exact_mut(each).zip(of_queries) {
            let factor = query * step.temperature[head];
            for (similar, key) in similar.iter_mut().zip(of_keys) {
                *similar *= factor * key;
            }
            softmax(similar);
        }
        // From a row per output to a row per value.
        for i in 0..each {
            for j in 0..i {
                shares.swap(i * each + j, j * each + i);
            }
        }
    }
}

#[inline(always)]
fn add(sums: &mut [f32], values: &[f32]) {
    for (sum, value) in sums.iter_mut().zip(values) {
        *sum += value;
    }
}

#[inline(always)]
fn softmax(values: &mut [f32]) {
    let most = values.iter().copied().fold(f32::NEG_INFINITY, f32::max);
    let mut sum = 0.0;
    for value in values.iter_mut() {
        *value = (*value - most).exp();
        sum += *value;
    }
    for value in values.iter_mut() {
        *value /= sum;
    }
}

/// Computes a row of the image.
struct Mix<'a, E> {
    step: &'a CrossCovarianceStep,
    arena: Shared<'a, E>,
    shares: &'a [f32],
    y: usize,
}

/// Number of a head's channels that are computed at once.
const AT_ONCE: usize = 32;

impl<E: Element> WithSimd for Mix<'_, E> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, _: S) {
        let Self {
            step,
            arena,
            shares,
            y,
        } = self;
        let each = step.each();
        for x in 0..step.out.width {
            let from = step.input.at(x, y) + 2 * step.channels;
            // SAFETY: a pixel of the output, whose row is used by this task only (the contract of `run`).
            let out = unsafe { arena.write(step.out.at(x, y), step.out.channels) };
            // Padding.
            out[step.channels..].fill(E::of(0.0));
            let heads = out[..step.channels].chunks_exact_mut(each);
            for (head, out) in heads.enumerate() {
                // SAFETY: channels of a pixel of the view, which nobody writes.
                let values = unsafe { arena.read(from + head * each, each) };
                let shares = &shares[head * each * each..][..each * each];
                for (part, out) in out.chunks_mut(AT_ONCE).enumerate() {
                    let mut sums = [0.0_f32; AT_ONCE];
                    let sums = &mut sums[..out.len()];
                    for (value, row) in values.iter().zip(shares.chunks_exact(each)) {
                        let value = value.value();
                        let row = &row[part * AT_ONCE..];
                        for (sum, share) in sums.iter_mut().zip(row) {
                            *sum += value * share;
                        }
                    }
                    for (out, sum) in out.iter_mut().zip(sums) {
                        *out = E::of(*sum);
                    }
                }
            }
        }
    }
}
