//! Depthwise convolution: every channel has its own kernel.

use pulp::{Simd, WithSimd};
use rayon::prelude::*;

use crate::Depthwise;
use crate::aligned::Aligned;
use crate::dispatch::dispatch;
use crate::element::Element;
use crate::tile::LANES;
use crate::view::{Shared, View};

/// Taps of a 3×3 kernel.
const TAPS: usize = 9;

/// A depthwise convolution ready to run.
#[derive(Debug)]
pub(crate) struct DepthwiseStep {
    pub(crate) input: View,
    pub(crate) out: View,
    kernel: usize,
    stride: usize,
    dilation: usize,
    /// For each physical channel its bias, then its taps: one row of channels for each.
    rows: Aligned<f32>,
}

impl DepthwiseStep {
    /// `channel_of` maps physical to logical channels; padding has zeros.
    pub(crate) fn new(
        op: &Depthwise,
        input: View,
        out: View,
        channel_of: &[Option<usize>],
    ) -> Self {
        let (channels, taps) = (channel_of.len(), op.kernel * op.kernel);
        let mut rows = Aligned::zeros((taps + 1) * channels);
        for (physical, logical) in channel_of.iter().enumerate() {
            let Some(c) = *logical else { continue };
            rows[physical] = op.bias[c];
            for tap in 0..taps {
                rows[(tap + 1) * channels + physical] = op.weight[c * taps + tap];
            }
        }
        Self {
            input,
            out,
            kernel: op.kernel,
            stride: op.stride,
            dilation: op.dilation,
            rows,
        }
    }

    /// # Safety
    /// The views and the input's border must be in the arena and must not overlap. Nobody else may use the output or write the input.
    pub(crate) unsafe fn run<E: Element>(&self, arena: Shared<E>) {
        (0..self.out.height).into_par_iter().for_each(|y| {
            dispatch(Row {
                step: self,
                arena,
                y,
            });
        });
    }
}

struct Row<'a, E> {
    step: &'a DepthwiseStep,
    arena: Shared<'a, E>,
    y: usize,
}

impl<E: Element> WithSimd for Row<'_, E> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, _: S) {
        let Self { step, arena, y } = self;
        let (input, out, channels) = (&step.input, &step.out, step.out.channels);
        let back = step.kernel / 2 * step.dilation * (input.row + input.pitch);
        let corner = input.at(0, y * step.stride) - back;
        let across = step.stride * input.pitch;
        let whole = if step.kernel == 3 {
            channels / LANES * LANES
        } else {
            0
        };
        let tap_at = |tap: usize| {
            let (ky, kx) = (tap / step.kernel, tap % step.kernel);
            step.dilation * (ky * input.row + kx * input.pitch)
        };
        let taps: [usize; TAPS] =
            std::array::from_fn(|tap| if whole > 0 { tap_at(tap) } else { 0 });
        for first in (0..whole).step_by(LANES) {
            // All weights of a vector of channels at once: they stay in registers along the row.
            let row = |i: usize| -> [f32; LANES] {
                std::array::from_fn(|lane| step.rows[i * channels + first + lane])
            };
            let bias = row(0);
            let weights: [[f32; LANES]; TAPS] = std::array::from_fn(|tap| row(tap + 1));
            for x in 0..out.width {
                let mut sums = bias;
                for (tap, weights) in taps.iter().zip(&weights) {
                    // SAFETY: channels of a pixel of the input or its border, which nobody writes (the contract of `run`).
                    let values = unsafe { arena.read(corner + x * across + tap + first, LANES) };
                    for ((sum, value), weight) in sums.iter_mut().zip(values).zip(weights) {
                        *sum += value.value() * weight;
                    }
                }
                // SAFETY: channels of a pixel of the output, whose row is used by this task only.
                let to = unsafe { arena.write(out.at(x, y) + first, LANES) };
                for (to, sum) in to.iter_mut().zip(sums) {
                    *to = E::of(sum);
                }
            }
        }
        for x in 0..out.width {
            for channel in whole..channels {
                let mut sum = step.rows[channel];
                for tap in 0..step.kernel * step.kernel {
                    let at = corner + x * across + tap_at(tap) + channel;
                    // SAFETY: as above.
                    let value = unsafe { arena.read(at, 1) }[0].value();
                    sum += value * step.rows[(tap + 1) * channels + channel];
                }
                // SAFETY: as above.
                let to = unsafe { arena.write(out.at(x, y) + channel, 1) };
                to[0] = E::of(sum);
            }
        }
    }
}
