//! 3×3 sums at stride 1 by Winograd's F(4×4, 3×3): 36 products for 16 outputs instead of 144.
//!
//! This module has the forward pass and the input gradient; [`weight_gradient`] has the weight gradient. Rounding errors are about four
//! times those of plain sums.
//!
//! Y = Aᵀ [ (G g Gᵀ) ⊙ (Bᵀ d B) ] A for a tile of 6×6 inputs d, kernel g and 4×4 outputs Y (Lavin and Gray, "Fast Algorithms for
//! Convolutional Neural Networks", 2016). The sums of ⊙ over channels are 36 matrix products, whose columns are tiles, so images stay
//! planar. A tile's sums do not depend on the other tiles computed with it, so the result is bit for bit the same for any number of threads
//! and tasks.

mod backward_transform;
mod image;
mod tiles;
mod transform;
mod weight_gradient;

#[cfg(test)]
mod tests;

pub(super) use image::{Image, Margins};
pub(super) use weight_gradient::WeightGradient;

use super::product::{LANES, TapProduct, padded};
use crate::scratch::with_scratch;
use crate::send_ptr::SharedMut;
use crate::winograd::AREA;
use pulp::Arch;
use rayon::prelude::*;
use std::ops::Range;
use tiles::{Grid, Run};
use transform::{TransformKernels, TransformOutputs};

/// Number of tiles of a batch below which transforming the kernels, which become four times as large, costs more than it saves.
const FEWEST_TILES: usize = 64;
/// Number of kernels below which moving values takes as long as multiplying them.
const FEWEST_KERNELS: usize = 512;

/// A sum over channels and 3×3 taps at stride 1: a convolution, or the gradient of its input.
#[derive(Clone, Copy)]
pub(super) struct Sum<'a> {
    pub(super) source: Image<'a>,
    /// Output rows and columns.
    pub(super) out: (usize, usize),
    /// Output channels.
    pub(super) rows: usize,
    pub(super) kernels: Kernels<'a>,
    pub(super) bias: Option<&'a [f32]>,
}

/// The kernels of a sum, in the layout of a convolution's weights: nine taps each, one after the other.
#[derive(Clone, Copy)]
pub(super) struct Kernels<'a> {
    pub(super) values: &'a [f32],
    /// Distance from one output channel to the next, and from one input channel to the next.
    pub(super) strides: (usize, usize),
    /// Whether the kernels are rotated by 180 degrees.
    pub(super) turned: bool,
}

impl Sum<'_> {
    /// Whether this form is faster than plain sums, according to `benches/conv.rs`. It depends on the number of images, so the results for
    /// an image alone and in a batch may differ by rounding.
    pub(super) fn is_faster(&self) -> bool {
        let grid = Grid::new(self.source.images, self.out);
        self.source.channels.is_multiple_of(LANES)
            && self.rows * self.source.channels >= FEWEST_KERNELS
            && grid.count() >= FEWEST_TILES
            && grid.saves_half(self.out)
    }

    /// Calls `write` with all outputs, line by line: image, output channel, row and first column, values. No two lines overlap, and
    /// together they cover the whole output.
    ///
    /// # Panics
    /// If the input channels are not whole vectors.
    pub(super) fn run(&self, write: impl Fn(usize, usize, (usize, usize), &[f32]) + Sync) {
        let channels = self.source.channels;
        assert!(channels.is_multiple_of(LANES), "whole vectors of channels");
        with_scratch(AREA * self.rows * channels, |weights| {
            self.transform_kernels(weights);
            let grid = Grid::new(self.source.images, self.out);
            let tasks = grid.tasks(channels, self.rows);
            tasks.into_par_iter().for_each(|(tiles, rows)| {
                self.task(
                    &grid.runs(tiles.clone()),
                    tiles.len(),
                    rows,
                    weights,
                    &write,
                );
            });
        });
    }

    fn task(
        &self,
        runs: &[Run],
        tiles: usize,
        rows: Range<usize>,
        weights: &[f32],
        write: &impl Fn(usize, usize, (usize, usize), &[f32]),
    ) {
        let (channels, tiles) = (self.source.channels, padded(tiles));
        // Avoids a distance of whole pages between the products of neighbouring numbers.
        let product_len = rows.len() * tiles + LANES;
        let lens = [
            AREA * tiles * channels,
            AREA * product_len,
            AREA * tiles,
            self.source.line_len(runs),
        ];
        with_scratch(lens.iter().sum(), |buffer| {
            let (inputs, buffer) = buffer.split_at_mut(lens[0]);
            let (products, buffer) = buffer.split_at_mut(lens[1]);
            let (plain, line) = buffer.split_at_mut(lens[2]);
            let room = (&mut *plain, &mut *line);
            self.source
                .transform(0..channels, runs, tiles, room, inputs);
            let offsets: Vec<usize> = (0..channels).map(|c| c * AREA * tiles).collect();
            for product in 0..AREA {
                let weights = &weights[(product * self.rows + rows.start) * channels..];
                TapProduct {
                    weights: &weights[..rows.len() * channels],
                    weight_stride: channels,
                    offsets: &offsets,
                    source: &inputs[product * tiles..],
                    columns: tiles,
                    out: &mut products[product * product_len..][..rows.len() * tiles],
                    rows: rows.len(),
                }
                .run();
            }
            for (index, row) in rows.enumerate() {
                Arch::new().dispatch(TransformOutputs {
                    from: &products[index * tiles..],
                    pitch: product_len,
                    tiles,
                    bias: self.bias.map_or(0.0, |bias| bias[row]),
                    to: plain,
                    to_pitch: tiles,
                });
                image::scatter(self.out, runs, plain, tiles, line, |run, at, values| {
                    write(run.image, row, at, values);
                });
            }
        });
    }

    /// G g Gᵀ of every kernel: `to[(product·rows + row)·channels + channel]`.
    fn transform_kernels(&self, to: &mut [f32]) {
        /// Rows of a task: a channel's kernels of these rows are near each other in memory.
        const GROUP: usize = 8;
        let Kernels {
            values,
            strides: (row_stride, channel_stride),
            turned,
        } = self.kernels;
        let (rows, channels) = (self.rows, self.source.channels);
        let to = SharedMut::new(to);
        (0..rows.div_ceil(GROUP)).into_par_iter().for_each(|group| {
            let rows_of_task = group * GROUP..((group + 1) * GROUP).min(rows);
            let (mut taps, mut transformed) = ([[0.0; LANES]; 9], [[0.0; LANES]; AREA]);
            for first in (0..channels).step_by(LANES) {
                for row in rows_of_task.clone() {
                    for lane in 0..LANES {
                        let from = row * row_stride + (first + lane) * channel_stride;
                        let from = &values[from..][..9];
                        for tap in 0..9 {
                            taps[tap][lane] = from[tap];
                        }
                    }
                    if turned {
                        taps.reverse();
                    }
                    Arch::new().dispatch(TransformKernels {
                        taps: &taps,
                        to: &mut transformed,
                    });
                    for (product, values) in transformed.iter().enumerate() {
                        let at = (product * rows + row) * channels + first;
                        // SAFETY: whole vectors (asserted in `run`), so each task writes its own rows only.
                        unsafe { to.slice(at, LANES) }.copy_from_slice(values);
                    }
                }
            }
        });
    }
}
