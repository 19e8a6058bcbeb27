//! A convolution in f32, pixel by pixel, without im2col.

use pulp::{Simd, WithSimd};

use crate::aligned::Aligned;
use crate::conv::{Geometry, Runs, Tasks, padded_bias, weight};
use crate::dispatch::dispatch;
use crate::scratch::with_scratch;
use crate::tile::{GROUP, LANES, Pixel, Shift, Start, Sum, tiles};
use crate::view::Shared;
use crate::{Activation, Conv};

/// Inputs summed before the sums are written to memory, so that their weights stay in the L1 cache.
const INPUTS_AT_ONCE: usize = 160;
/// Output pixels of a task, so that their inputs and outputs stay in the L2 cache.
const PIXELS_AT_ONCE: usize = 480;

/// A convolution ready to run.
#[derive(Debug)]
pub(crate) struct Direct {
    pub(crate) geometry: Geometry,
    runs: Runs,
    /// For each group of [`GROUP`] output channels: a row of weights for every input of every run.
    panels: Aligned<f32>,
    bias: Vec<f32>,
}

impl Direct {
    pub(crate) fn new(conv: &Conv, geometry: Geometry, channel_of: &[Option<usize>]) -> Self {
        let runs = Runs::new(&geometry, channel_of, INPUTS_AT_ONCE, 1);
        let columns = conv.channels_out.next_multiple_of(LANES);
        let mut panels = Aligned::zeros(runs.sources.len() * columns);
        let mut rest = panels.iter_mut();
        for first in (0..columns).step_by(GROUP) {
            let width = GROUP.min(columns - first);
            for source in &runs.sources {
                for (o, to) in (first..first + width).zip(&mut rest) {
                    *to = weight(conv, o, *source);
                }
            }
        }
        Self {
            bias: padded_bias(conv, columns),
            geometry,
            runs,
            panels,
        }
    }

    /// # Safety
    /// `arena` must contain every view of the geometry, with its border. Nobody else may use the output during the call, or write the
    /// others.
    pub(crate) unsafe fn run(&self, arena: Shared<f32>) {
        let groups = self.bias.len().div_ceil(GROUP);
        Tasks::new(self.geometry.out.pixels(), PIXELS_AT_ONCE, 6, groups).run(|pixels, groups| {
            with_scratch(|scratch| {
                dispatch(Task {
                    conv: self,
                    arena,
                    pixels,
                    groups,
                    places: &mut scratch.pixels,
                });
            });
        });
    }
}

struct Task<'a> {
    conv: &'a Direct,
    arena: Shared<'a, f32>,
    pixels: std::ops::Range<usize>,
    groups: std::ops::Range<usize>,
    places: &'a mut Vec<Pixel>,
}

impl WithSimd for Task<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) {
        let Self {
            conv,
            arena,
            pixels,
            groups,
            places,
        } = self;
        let g = &conv.geometry;
        let corner = g.corner();
        let at_once = (INPUTS_AT_ONCE / conv.runs.len).max(1);
        let columns = conv.bias.len();
        places.clear();
        let mut p = pixels.start;
        while p < pixels.end {
            // The task's remaining pixels in this row.
            let (x, y) = (p % g.out.width, p / g.out.width);
            let count = (g.out.width - x).min(pixels.end - p);
            let input = corner + y * g.stride * g.input.row;
            let (extent, pitch) = (conv.runs.extent, g.stride * g.input.pitch);
            places.extend((x..x + count).map(|x| Pixel {
                input: arena.at(input + x * pitch, extent),
                out: arena.at(g.out.at(x, y), columns),
                residual: match &g.residual {
                    Some(view) => arena.at(view.at(x, y), columns),
                    None => std::ptr::null(),
                },
            }));
            p += count;
        }
        for group in groups {
            let first = group * GROUP;
            let width = GROUP.min(columns - first);
            let shift = Shift {
                input: 0,
                out: first,
            };
            let panel = &conv.panels[first * conv.runs.sources.len()..];
            let last = conv.runs.offsets.len().div_ceil(at_once) - 1;
            for (i, runs) in conv.runs.offsets.chunks(at_once).enumerate() {
                let sum = Sum {
                    runs,
                    len: conv.runs.len,
                    panel: panel[i * at_once * conv.runs.len * width..].as_ptr(),
                    stride: width,
                    start: match (i, &g.residual) {
                        (0, None) => Start::Bias(conv.bias[first..].as_ptr()),
                        (0, Some(_)) => Start::BiasAndResidual(conv.bias[first..].as_ptr()),
                        _ => Start::Out,
                    },
                    relu: i == last && g.activation == Activation::Relu,
                };
                // SAFETY: every pixel's inputs, outputs and residual are in the arena, as `at` has checked, and nobody else uses the
                // outputs (the contract of `run`); the panel has a row for every input.
                unsafe { tiles(simd, &sum, width, places, shift) };
            }
            if !matches!(g.activation, Activation::Identity | Activation::Relu) {
                for place in places.iter() {
                    // SAFETY: `width` of its columns, just written, by this task only.
                    unsafe { g.activation.apply(simd, place.out.add(first), width) };
                }
            }
        }
    }
}
