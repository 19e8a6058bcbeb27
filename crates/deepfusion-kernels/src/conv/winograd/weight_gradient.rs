//! The weight gradient by the same products: ∂g = Gᵀ [ Σ (A ∂Y Aᵀ) ⊙ (Bᵀ d B) ] G, the transpose of the forward form. The sums over tiles
//! are 36 matrix products. Parts and groups depend on sizes only, and are added in order.

use super::backward_transform::{TransformGradients, TransformTaps};
use super::image::Image;
use super::tiles::{Grid, Run};
use crate::conv::product::{LANES, PixelProduct, padded};
use crate::conv::transpose::transpose;
use crate::scratch::with_scratch;
use crate::winograd::{AREA, OUT};
use pulp::Arch;
use rayon::prelude::*;
use std::ops::Range;

/// Number of tiles of a batch below which plain sums are as fast.
const FEWEST_TILES: usize = 32;
/// Number of input channels below which transforming the output gradients takes as long as it saves. With 8, this form takes 0.84 of the
/// time of plain sums, with 4 already 0.95 (with 16 outputs, at 320×96).
const FEWEST_CHANNELS: usize = 8;

/// A weight gradient as sums over the tiles of a batch.
#[derive(Clone, Copy)]
pub(in crate::conv) struct WeightGradient<'a> {
    pub(in crate::conv) source: Image<'a>,
    /// Gradient of the outputs, N×O×H×W.
    pub(in crate::conv) grad_out: &'a [f32],
    /// Output channels.
    pub(in crate::conv) outputs: usize,
    /// Output rows and columns.
    pub(in crate::conv) out: (usize, usize),
}

/// Neighbouring tiles, and their transformed output gradients: `values[p·pitch + t·outputs + o]`.
struct TileBlock<'a> {
    runs: Vec<Run>,
    tiles: usize,
    values: &'a [f32],
}

impl WeightGradient<'_> {
    /// Whether this form is faster than plain sums, according to `benches/conv.rs`.
    pub(in crate::conv) fn is_faster(&self) -> bool {
        let grid = self.grid();
        self.source.channels >= FEWEST_CHANNELS
            && grid.count() >= FEWEST_TILES
            && grid.saves_half(self.out)
    }

    /// Tiles in parts, each of which is transformed at once.
    pub(in crate::conv) fn parts(&self) -> Vec<Range<usize>> {
        self.grid()
            .parts(self.source.channels + padded(self.outputs))
    }

    /// Length of the sums of `channels` channels: 9 taps × padded outputs each.
    pub(in crate::conv) fn sum_len(&self, channels: usize) -> usize {
        9 * channels * padded(self.outputs)
    }

    /// Writes the sums of all channels over some parts to `to`, taps × outputs.
    pub(in crate::conv) fn over(&self, parts: &[Range<usize>], to: &mut [f32]) {
        let all = 0..self.source.channels;
        self.summed(all, to, |add| {
            for tiles in parts {
                with_scratch(self.part_len(tiles), |values| {
                    add(&self.part(tiles, values));
                });
            }
        });
    }

    /// Calls `write` with the sums over all parts of each of the `groups` of channels, taps × outputs.
    pub(in crate::conv) fn by_channels(
        &self,
        groups: Vec<Range<usize>>,
        write: impl Fn(Range<usize>, &[f32]) + Sync,
    ) {
        let parts = self.parts();
        let lens = parts.iter().map(|tiles| self.part_len(tiles));
        with_scratch(lens.sum(), |mut rest| {
            let mut rooms = Vec::new();
            for tiles in &parts {
                let (room, after) = rest.split_at_mut(self.part_len(tiles));
                rooms.push((tiles, room));
                rest = after;
            }
            let transformed = rooms.into_par_iter();
            let parts: Vec<TileBlock> = transformed.map(|(t, room)| self.part(t, room)).collect();
            groups.into_par_iter().for_each(|channels| {
                with_scratch(self.sum_len(channels.len()), |sums| {
                    self.summed(channels.clone(), sums, |add| parts.iter().for_each(add));
                    write(channels, sums);
                });
            });
        });
    }

    fn grid(&self) -> Grid {
        Grid::new(self.source.images, self.out)
    }

    /// Number of values from one product of a part's transformed gradients to the next; not a multiple of whole pages.
    fn pitch(&self, tiles: usize) -> usize {
        tiles * padded(self.outputs) + LANES
    }

    fn part_len(&self, tiles: &Range<usize>) -> usize {
        AREA * self.pitch(tiles.len())
    }

    /// Transforms the output gradients of some tiles into `values`.
    fn part<'a>(&self, tiles: &Range<usize>, values: &'a mut [f32]) -> TileBlock<'a> {
        let runs = self.grid().runs(tiles.clone());
        let (outputs, pitch) = (padded(self.outputs), self.pitch(tiles.len()));
        let longest = runs.iter().map(|run| run.tiles).max().unwrap_or(0);
        with_scratch(OUT * OUT * longest * outputs, |lines| {
            for run in &runs {
                let line = OUT * run.tiles * outputs;
                self.transposed(run, outputs, &mut lines[..OUT * line]);
                Arch::new().dispatch(TransformGradients {
                    from: lines,
                    pitch: line,
                    tiles: run.tiles,
                    channels: outputs,
                    to: &mut values[run.at * outputs..],
                    to_pitch: pitch,
                });
            }
        });
        TileBlock {
            runs,
            tiles: tiles.len(),
            values,
        }
    }

    /// The lines of a run's output gradients with interleaved channels; zero outside the image.
    fn transposed(&self, run: &Run, outputs: usize, lines: &mut [f32]) {
        let (height, width) = self.out;
        let count = (OUT * run.tiles).min(width - run.x);
        for (i, line) in lines
            .chunks_exact_mut(OUT * run.tiles * outputs)
            .enumerate()
        {
            let y = run.y + i;
            let (inside, outside) = line.split_at_mut(count * outputs);
            outside.fill(0.0);
            if y >= height {
                inside.fill(0.0);
                continue;
            }
            let first = run.image * self.outputs * height * width + y * width + run.x;
            let from = &self.grad_out[first..];
            transpose(from, height * width, self.outputs, count, inside, outputs);
        }
    }

    /// `each` adds parts to the sums of `channels`, which are then written to `to`, taps × outputs.
    fn summed(
        &self,
        channels: Range<usize>,
        to: &mut [f32],
        each: impl FnOnce(&mut dyn FnMut(&TileBlock)),
    ) {
        let outputs = padded(self.outputs);
        let pitch = channels.len() * outputs;
        with_scratch(AREA * pitch, |sums| {
            sums.fill(0.0);
            each(&mut |part| self.add(part, channels.clone(), sums));
            for (index, to) in to.chunks_exact_mut(9 * outputs).enumerate() {
                Arch::new().dispatch(TransformTaps {
                    from: &sums[index * outputs..],
                    pitch,
                    outputs,
                    to,
                });
            }
        });
    }

    /// Adds a part's products to `sums`, products × channels × outputs.
    fn add(&self, part: &TileBlock, channels: Range<usize>, sums: &mut [f32]) {
        let (tiles, outputs) = (padded(part.tiles), padded(self.outputs));
        let lens = [
            AREA * tiles * channels.len(),
            AREA * tiles,
            self.source.line_len(&part.runs),
        ];
        with_scratch(lens.iter().sum(), |buffer| {
            let (inputs, buffer) = buffer.split_at_mut(lens[0]);
            let (plain, line) = buffer.split_at_mut(lens[1]);
            self.source
                .transform(channels.clone(), &part.runs, tiles, (plain, line), inputs);
            let offsets: Vec<usize> = (0..channels.len()).map(|c| c * AREA * tiles).collect();
            let pixels: Vec<usize> = (0..part.tiles).collect();
            let pitch = self.pitch(part.tiles);
            for (product, sums) in sums.chunks_exact_mut(channels.len() * outputs).enumerate() {
                PixelProduct {
                    offsets: &offsets,
                    source: &inputs[product * tiles..],
                    pixels: &pixels,
                    grad: &part.values[product * pitch..][..part.tiles * outputs],
                    columns: outputs,
                    out: sums,
                }
                .run();
            }
        });
    }
}
