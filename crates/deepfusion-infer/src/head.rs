//! A convolution to one channel: lanes along the inputs.

use pulp::{Simd, WithSimd};
use rayon::prelude::*;

use crate::Conv;
use crate::conv::{Geometry, Runs, weight};
use crate::dispatch::dispatch;
use crate::tile::LANES;
use crate::view::Shared;

/// A convolution to one channel, ready to run.
#[derive(Debug)]
pub(crate) struct Head {
    geometry: Geometry,
    runs: Runs,
    /// One for every input of every run.
    weights: Vec<f32>,
    bias: f32,
}

impl Head {
    /// # Panics
    /// When there is more than one output channel.
    pub(crate) fn new(conv: &Conv, geometry: Geometry, channel_of: &[Option<usize>]) -> Self {
        assert_eq!(conv.channels_out, 1, "a head has one channel");
        let runs = Runs::new(&geometry, channel_of, usize::MAX, LANES);
        let weights = runs.sources.iter().map(|s| weight(conv, 0, *s)).collect();
        Self {
            geometry,
            runs,
            weights,
            bias: conv.bias[0],
        }
    }

    /// # Safety
    /// As [`crate::direct::Direct::run`].
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
    arena: Shared<f32>,
    y: usize,
}

impl WithSimd for Row<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) {
        let Self { head, arena, y } = self;
        let g = &head.geometry;
        let corner = g.corner() + y * g.stride * g.input.row;
        let vectors = head.runs.len / S::F32_LANES;
        for x in 0..g.out.width {
            let mut sum = simd.splat_f32s(0.0);
            // SAFETY: the views lie in the arena; weights are as many as the runs' inputs.
            unsafe {
                let pixel = arena.at(corner + x * g.stride * g.input.pitch);
                let mut weights = head.weights.as_ptr().cast::<S::f32s>();
                for &run in &head.runs.offsets {
                    let input = pixel.add(run).cast::<S::f32s>();
                    for v in 0..vectors {
                        let (w, x) = (weights.read_unaligned(), input.add(v).read_unaligned());
                        weights = weights.add(1);
                        sum = simd.mul_add_f32s(w, x, sum);
                    }
                }
                *arena.at(g.out.at(x, y)) = simd.reduce_sum_f32s(sum) + head.bias;
            }
        }
        // SAFETY: a head's output has one channel a pixel, the row lies in its view.
        unsafe {
            g.activation
                .apply(simd, arena.at(g.out.at(0, y)), g.out.width)
        };
    }
}
