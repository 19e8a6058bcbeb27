//! A convolution to one channel, with vectors along the inputs.

use pulp::{Simd, WithSimd};
use rayon::prelude::*;

use crate::Conv;
use crate::conv::{Geometry, Runs, weight};
use crate::dispatch::dispatch;
use crate::view::Shared;

/// A convolution to one channel, ready to run.
#[derive(Debug)]
pub(crate) struct Head {
    pub(crate) geometry: Geometry,
    runs: Runs,
    /// One weight for every input of every run.
    weights: Vec<f32>,
    bias: f32,
}

impl Head {
    /// # Panics
    /// If there is more than one output channel.
    pub(crate) fn new(conv: &Conv, geometry: Geometry, channel_of: &[Option<usize>]) -> Self {
        assert_eq!(conv.channels_out, 1, "a head has one channel");
        let runs = Runs::new(&geometry, channel_of, usize::MAX, 1);
        let weights = runs.sources.iter().map(|s| weight(conv, 0, *s)).collect();
        Self {
            geometry,
            runs,
            weights,
            bias: conv.bias[0],
        }
    }

    /// # Safety
    /// As for [`crate::direct::Direct::run`].
    pub(crate) unsafe fn run(&self, arena: Shared<f32>) {
        (0..self.geometry.out.height).into_par_iter().for_each(|y| {
            dispatch(Row {
                head: self,
                arena,
                y,
            });
        });
    }
}

struct Row<'a> {
    head: &'a Head,
    arena: Shared<'a, f32>,
    y: usize,
}

impl WithSimd for Row<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) {
        let Self { head, arena, y } = self;
        let g = &head.geometry;
        let corner = g.corner() + y * g.stride * g.input.row;
        let whole = head.runs.len / S::F32_LANES * S::F32_LANES;
        for x in 0..g.out.width {
            let pixel = arena.at(corner + x * g.stride * g.input.pitch, head.runs.extent);
            let mut weights = head.weights.as_ptr();
            let (mut sum, mut rest) = (simd.splat_f32s(0.0), head.bias);
            for &run in &head.runs.offsets {
                // SAFETY: the runs are within their extent, which nobody writes (the contract of `run`); there are as many weights as the
                // runs have inputs.
                unsafe {
                    for k in (0..whole).step_by(S::F32_LANES) {
                        let w = weights.add(k).cast::<S::f32s>().read_unaligned();
                        let x = pixel.add(run + k).cast::<S::f32s>().read_unaligned();
                        sum = simd.mul_add_f32s(w, x, sum);
                    }
                    // Inputs from the image or an extent, whose channels are not whole vectors.
                    for k in whole..head.runs.len {
                        rest += *weights.add(k) * *pixel.add(run + k);
                    }
                    weights = weights.add(head.runs.len);
                }
            }
            // SAFETY: a pixel of the output, whose row is used by this task only.
            unsafe { *arena.at(g.out.at(x, y), 1) = simd.reduce_sum_f32s(sum) + rest };
        }
        let row = arena.at(g.out.at(0, y), g.out.width);
        // SAFETY: a head's output has one channel per pixel and no border, so these values are in this task's row.
        unsafe { g.activation.apply(simd, row, g.out.width) };
    }
}
