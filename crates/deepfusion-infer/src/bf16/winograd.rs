//! 3×3 convolutions at stride 1 in bf16 by Winograd's F(2×2, 3×3): 16 products for 4 pixels instead of 36. Each of the 16 is a matrix
//! product, computed with AVX-512's dot products of pairs.
//!
//! y = Aᵀ [ (G g Gᵀ) ⊙ (Bᵀ d B) ] A for a tile of 4×4 inputs d, kernel g and 2×2 outputs y (Lavin and Gray, "Fast Algorithms for
//! Convolutional Neural Networks", 2016). Kernels and inputs are transformed in f32 and rounded once more; larger tiles would amplify that
//! rounding too much. On the matrix unit, plain sums are faster.

use std::arch::x86_64::{
    __m256bh, __m256i, __m512, _mm256_loadu_si256, _mm256_storeu_si256, _mm512_add_ps,
    _mm512_castsi512_ps, _mm512_cvtepu16_epi32, _mm512_cvtneps_pbh, _mm512_loadu_ps,
    _mm512_setzero_ps, _mm512_slli_epi32, _mm512_sub_ps,
};
use std::mem::transmute;
use std::ops::Range;

use rayon::prelude::*;

use super::dot::{INPUTS_AT_ONCE, ROWS, Tile};
use super::{Epilogue, OutputPixel};
use crate::Conv;
use crate::aligned::Aligned;
use crate::conv::{Geometry, padded_bias, weight};
use crate::element::{Bf16, Element};
use crate::scratch::with_scratch;
use crate::tile::{GROUP, LANES};
use crate::view::Shared;
use crate::winograd_tiles::{TileOrigin, Tiles};

/// Outputs of a tile along one side.
const OUT: usize = 2;
/// Inputs of a tile along one side.
const IN: usize = 4;
/// Products of a tile.
const AREA: usize = IN * IN;
/// Minimum number of input and output channels: with fewer, the transforms cost more than the saved products.
const LEAST_CHANNELS: usize = 32;
/// Minimum number of pixels: they share the transformed weights, which are nearly twice as large.
const LEAST_PIXELS: usize = 400;
/// Maximum number of bytes of transformed inputs and products of a task, so that they stay in the L2 cache. If the weights are too large for
/// that cache, a task may take half as many bytes as the weights, since each task reads all weights.
const BYTES_AT_ONCE: usize = 600_000;

/// A convolution ready to run.
#[derive(Debug)]
pub(crate) struct WinogradDot {
    geometry: Geometry,
    /// Physical input channels.
    channels: usize,
    /// For each of the 16 products, each group of [`GROUP`] output channels and each pair of inputs: the pair's weights, channel by channel.
    panels: Aligned<Bf16>,
    bias: Vec<f32>,
    /// Number of tiles in a task.
    tiles: usize,
}

/// G g Gᵀ for the points 0, 1, −1, ∞.
fn transformed_kernel(g: &[f32; 9]) -> [f32; AREA] {
    let axis = |[a, b, c]: [f32; 3]| [a, (a + b + c) / 2.0, (a - b + c) / 2.0, c];
    let rows = [0, 1, 2].map(|y| axis([g[3 * y], g[3 * y + 1], g[3 * y + 2]]));
    let mut out = [0.0; AREA];
    for j in 0..IN {
        for (i, value) in axis([rows[0][j], rows[1][j], rows[2][j]])
            .into_iter()
            .enumerate()
        {
            out[i * IN + j] = value;
        }
    }
    out
}

impl WinogradDot {
    /// Whether this form is faster for a convolution: 3×3 at stride 1, with enough channels and pixels. Input channels must be whole
    /// vectors.
    pub(crate) fn fits(conv: &Conv, geometry: &Geometry, channel_of: &[Option<usize>]) -> bool {
        if conv.kernel != 3 || conv.stride != 1 || geometry.out.result {
            return false;
        }
        let pixels = geometry.out.pixels();
        // Including the products of pixels that only complete tiles, which are many if a phase has few pixels.
        let products = AREA * Tiles::new(geometry, OUT).count();
        channel_of.len().is_multiple_of(LANES)
            && channel_of.len() >= LEAST_CHANNELS
            && conv.channels_out >= LEAST_CHANNELS
            && pixels >= LEAST_PIXELS
            && 5 * products <= 4 * geometry.taps() * pixels
    }

    pub(crate) fn new(conv: &Conv, geometry: Geometry, channel_of: &[Option<usize>]) -> Self {
        let channels = channel_of.len();
        let columns = conv.channels_out.next_multiple_of(LANES);
        let mut panels = Aligned::zeros(AREA * channels * columns);
        for (c, channel) in channel_of.iter().enumerate() {
            let Some(channel) = *channel else { continue };
            for out in 0..conv.channels_out {
                let kernel = std::array::from_fn(|tap| weight(conv, out, Some((channel, tap))));
                let first = out / GROUP * GROUP;
                let width = GROUP.min(columns - first);
                let place = c / 2 * 2 * width + 2 * (out - first) + c % 2;
                for (product, value) in transformed_kernel(&kernel).into_iter().enumerate() {
                    let panel = (product * columns + first) * channels;
                    panels[panel + place] = Bf16::of(value);
                }
            }
        }
        let bytes = AREA * (2 * channels + 4 * columns);
        let at_once = BYTES_AT_ONCE.max(size_of_val(&panels[..]) / 2);
        Self {
            bias: padded_bias(conv, columns),
            tiles: (at_once / bytes / ROWS * ROWS).max(ROWS),
            geometry,
            channels,
            panels,
        }
    }

    pub(crate) fn geometry(&self) -> &Geometry {
        &self.geometry
    }

    /// # Safety
    /// As for [`crate::conv::ConvForm::run`]; the processor must have the instructions.
    pub(crate) unsafe fn run(&self, arena: Shared<Bf16>) {
        let all = Tiles::new(&self.geometry, OUT).count();
        // The number of tasks is a multiple of the number of threads, which matters if there are few.
        let rounds = all
            .div_ceil(self.tiles)
            .next_multiple_of(rayon::current_num_threads());
        let tiles = all.div_ceil(rounds).next_multiple_of(ROWS);
        (0..all.div_ceil(tiles)).into_par_iter().for_each(|task| {
            let tiles = task * tiles..((task + 1) * tiles).min(all);
            with_scratch(|scratch| {
                let inputs = scratch.halves.take(AREA * tiles.len() * self.channels);
                let whole = tiles.len().next_multiple_of(ROWS);
                let products = scratch.first.take(AREA * whole * self.bias.len());
                // SAFETY: guaranteed by the caller; each tile belongs to one task.
                unsafe { self.task(arena, tiles, inputs, products) };
            });
        });
    }

    /// # Safety
    /// As for [`Self::run`], and the tiles of the output must be used by this thread only.
    #[target_feature(enable = "avx2,fma,avx512f,avx512bw,avx512dq,avx512vl,avx512bf16")]
    unsafe fn task(
        &self,
        arena: Shared<Bf16>,
        tiles: Range<usize>,
        inputs: &mut [Bf16],
        products: &mut [f32],
    ) {
        let places = Tiles::new(&self.geometry, OUT);
        let size = AREA * self.channels;
        for (tile, to) in tiles.clone().zip(inputs.chunks_exact_mut(size)) {
            // SAFETY: nobody writes the input (guaranteed by the caller).
            unsafe { self.transform_input(arena, places.of(tile), to) };
        }
        // SAFETY: inputs and products are long enough for this number of tiles.
        unsafe { self.multiply(inputs, products) };
        let columns = self.bias.len();
        let finish = Epilogue::new(&self.geometry, &self.bias, arena);
        for (tile, from) in tiles.zip(products.chunks_exact(AREA * columns)) {
            // SAFETY: the tile's pixels are used by this thread only (guaranteed by the caller).
            unsafe { self.transform_output(&finish, from, places.of(tile)) };
        }
    }

    /// Bᵀ d B for all channels of a tile; product (i, j) of channel c goes to `to[(i·4 + j)·channels + c]`.
    ///
    /// # Safety
    /// Nobody may write the input during the call; the processor must have the instructions.
    #[target_feature(enable = "avx2,fma,avx512f,avx512bw,avx512dq,avx512vl,avx512bf16")]
    unsafe fn transform_input(
        &self,
        arena: Shared<Bf16>,
        TileOrigin { x, y, step }: TileOrigin,
        to: &mut [Bf16],
    ) {
        let (view, channels) = (&self.geometry.input, self.channels);
        assert_eq!(to.len(), AREA * channels, "a tile's products");
        let to = to.as_mut_ptr();
        // Inputs beyond the border only affect outputs outside the image.
        let column = |i: usize| (x + i * step).min(view.width - 1 + 2 * step) * view.pitch;
        let row = |i: usize| (y + i * step).min(view.height - 1 + 2 * step) * view.row;
        let corner = view.offset - step * (view.row + view.pitch);
        let columns: [usize; IN] = std::array::from_fn(column);
        let rows: [usize; IN] = std::array::from_fn(row);
        // Includes the last pixel's last channel, as rows and columns only increase.
        let from = arena.at(corner, rows[IN - 1] + columns[IN - 1] + channels);
        let from = from.cast_const();
        for c in (0..channels).step_by(LANES) {
            let mut half = [[_mm512_setzero_ps(); IN]; IN];
            // SAFETY: the inputs read are in the arena, as was just checked, and nobody writes them (guaranteed by the caller); `to` has
            // room for every product of every channel.
            unsafe {
                for j in 0..IN {
                    let mut d = [_mm512_setzero_ps(); IN];
                    for i in 0..IN {
                        d[i] = load(from.add(rows[i] + columns[j] + c));
                    }
                    let d = input_axis(d);
                    for i in 0..IN {
                        half[i][j] = d[i];
                    }
                }
                for (i, half) in half.into_iter().enumerate() {
                    for (j, value) in input_axis(half).into_iter().enumerate() {
                        let rounded = transmute::<__m256bh, __m256i>(_mm512_cvtneps_pbh(value));
                        let at = to.add((i * IN + j) * channels + c);
                        _mm256_storeu_si256(at.cast(), rounded);
                    }
                }
            }
        }
    }

    /// The 16 products of all tiles, summed over channels: `products[(tile·16 + product)·columns + o]`.
    ///
    /// # Safety
    /// The processor must have the instructions.
    ///
    /// # Panics
    /// If `products` has no room for the tiles of the inputs and those that complete the last group.
    #[target_feature(enable = "avx512f,avx512bf16")]
    unsafe fn multiply(&self, inputs: &[Bf16], products: &mut [f32]) {
        let (columns, channels) = (self.bias.len(), self.channels);
        let count = inputs.len() / (AREA * channels);
        let room = AREA * count.next_multiple_of(ROWS) * columns;
        assert!(products.len() >= room, "products of all tiles");
        let part = channels
            .div_ceil(channels.div_ceil(INPUTS_AT_ONCE))
            .next_multiple_of(LANES);
        for product in 0..AREA {
            for first in (0..columns).step_by(GROUP) {
                let width = GROUP.min(columns - first);
                let panel = &self.panels[(product * columns + first) * channels..];
                for from in (0..channels).step_by(part) {
                    for tile in (0..count).step_by(ROWS) {
                        // If too few tiles are left, the last one is repeated; those sums are ignored.
                        let rows: [*const Bf16; ROWS] = std::array::from_fn(|r| {
                            let tile = (tile + r).min(count - 1);
                            inputs[(tile * AREA + product) * channels..].as_ptr()
                        });
                        for column in (0..width).step_by(2 * LANES) {
                            let sums = (tile * AREA + product) * columns + first + column;
                            let tile = Tile {
                                rows,
                                runs: &[from],
                                len: part.min(channels - from),
                                panel: panel[from * width + 2 * column..].as_ptr(),
                                stride: 2 * width,
                                add: from > 0,
                                sums: products[sums..].as_mut_ptr(),
                                pitch: AREA * columns,
                            };
                            // SAFETY: each row has `channels` inputs, the panel has a row of weights for every pair of them, and the sums
                            // of the last tile end within `products`. The processor has the instructions (guaranteed by the caller).
                            unsafe {
                                if width - column >= 2 * LANES {
                                    tile.run::<2>();
                                } else {
                                    tile.run::<1>();
                                }
                            }
                        }
                    }
                }
            }
        }
    }

    /// Aᵀ m A with bias, residual and activation, for the pixels of the tile that are in the image.
    ///
    /// # Safety
    /// Nobody else may use those pixels of the output, or write those of the residual; the processor must have the instructions.
    #[target_feature(enable = "avx2,fma,avx512f,avx512bw,avx512dq,avx512vl,avx512bf16")]
    unsafe fn transform_output(&self, finish: &Epilogue<'_>, from: &[f32], origin: TileOrigin) {
        let (g, columns) = (&self.geometry, self.bias.len());
        assert_eq!(from.len(), AREA * columns, "a tile's products");
        let (across, down) = origin.inside(g, OUT);
        let TileOrigin { x, y, step } = origin;
        for c in (0..columns).step_by(LANES) {
            let mut half = [[_mm512_setzero_ps(); IN]; OUT];
            for j in 0..IN {
                let mut m = [_mm512_setzero_ps(); IN];
                for i in 0..IN {
                    let at = from[(i * IN + j) * columns + c..][..LANES].as_ptr();
                    // SAFETY: sixteen values.
                    m[i] = unsafe { _mm512_loadu_ps(at) };
                }
                let m = output_axis(m);
                for i in 0..OUT {
                    half[i][j] = m[i];
                }
            }
            for (i, half) in half.into_iter().enumerate().take(down) {
                for (j, value) in output_axis(half).into_iter().enumerate().take(across) {
                    let place = OutputPixel::new(g, x + j * step, y + i * step);
                    // SAFETY: guaranteed by the caller.
                    unsafe { finish.vector(place, c, value) };
                }
            }
        }
    }
}

/// Sixteen values of bf16.
///
/// # Safety
/// They must be readable, and the processor must have the instructions.
#[inline]
#[target_feature(enable = "avx512f,avx512bw")]
unsafe fn load(from: *const Bf16) -> __m512 {
    // SAFETY: guaranteed by the caller.
    let bits = unsafe { _mm256_loadu_si256(from.cast()) };
    _mm512_castsi512_ps(_mm512_slli_epi32::<16>(_mm512_cvtepu16_epi32(bits)))
}

/// Bᵀ d along one axis.
#[inline]
#[target_feature(enable = "avx512f")]
fn input_axis(d: [__m512; IN]) -> [__m512; IN] {
    [
        _mm512_sub_ps(d[0], d[2]),
        _mm512_add_ps(d[1], d[2]),
        _mm512_sub_ps(d[2], d[1]),
        _mm512_sub_ps(d[1], d[3]),
    ]
}

/// Aᵀ m along one axis.
#[inline]
#[target_feature(enable = "avx512f")]
fn output_axis(m: [__m512; IN]) -> [__m512; OUT] {
    [
        _mm512_add_ps(m[0], _mm512_add_ps(m[1], m[2])),
        _mm512_sub_ps(_mm512_sub_ps(m[1], m[2]), m[3]),
    ]
}
