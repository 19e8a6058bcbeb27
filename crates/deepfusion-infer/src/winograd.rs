//! 3×3 convolutions at stride 1 by Winograd's F(4×4, 3×3): 36 products for 16 pixels instead of 144.
//!
//! y = Aᵀ [ (G g Gᵀ) ⊙ (Bᵀ d B) ] A for a tile of 6×6 inputs d, kernel g and 4×4 outputs y (Lavin and Gray,
//! "Fast Algorithms for Convolutional Neural Networks", 2016). The sums over channels of ⊙ are 36
//! matrix products.

use deepfusion_kernels::winograd::{AREA, IN, OUT, input_axis, output_axis};
use pulp::{Simd, WithSimd};
use rayon::prelude::*;

use crate::Conv;
use crate::aligned::Aligned;
use crate::conv::{Geometry, padded_bias, weight};
use crate::dispatch::dispatch;
use crate::scratch::with_scratch;
use crate::tile::{GROUP, LANES, Pixel, Shift, Start, Sum, tiles};
use crate::view::{Shared, View};
use crate::winograd_tiles::{TileOrigin, Tiles};

/// Maximum number of channels transformed at once.
const CHANNELS_AT_ONCE: usize = 128;
/// Number of transformed inputs and products of a task, so that they stay in the L2 cache.
const VALUES_AT_ONCE: usize = 280_000;

/// G: a kernel's three taps at the points 0, 1, −1, 2, −2, ∞.
const G: [[f64; 3]; IN] = [
    [0.25, 0.0, 0.0],
    [-1.0 / 6.0, -1.0 / 6.0, -1.0 / 6.0],
    [-1.0 / 6.0, 1.0 / 6.0, -1.0 / 6.0],
    [1.0 / 24.0, 1.0 / 12.0, 1.0 / 6.0],
    [1.0 / 24.0, -1.0 / 12.0, 1.0 / 6.0],
    [0.0, 0.0, 1.0],
];

/// A convolution ready to run.
#[derive(Debug)]
pub(crate) struct Winograd {
    pub(crate) geometry: Geometry,
    /// Physical input channels, divided into parts of at most [`CHANNELS_AT_ONCE`].
    parts: Vec<std::ops::Range<usize>>,
    /// For each part, each of the 36 products and each group of [`GROUP`] output channels: a row of weights for every input channel.
    panels: Aligned<f32>,
    bias: Vec<f32>,
    /// Number of tiles in a task.
    tiles: usize,
}

impl Winograd {
    /// Whether this form is faster for a convolution: 3×3 at stride 1, with enough pixels to share the transformed weights, which are four
    /// times as large. Input channels must be whole vectors.
    pub(crate) fn fits(conv: &Conv, geometry: &Geometry, channel_of: &[Option<usize>]) -> bool {
        let pixels = geometry.out.pixels();
        if conv.kernel != 3 || conv.stride != 1 || pixels < 1024 {
            return false;
        }
        // Including the products of pixels that only complete tiles, which are many if a phase has few pixels.
        let products = AREA * Tiles::new(geometry, OUT).count();
        channel_of.len().is_multiple_of(LANES) && 2 * products <= geometry.taps() * pixels
    }

    pub(crate) fn new(conv: &Conv, geometry: Geometry, channel_of: &[Option<usize>]) -> Self {
        let channels = channel_of.len();
        let count = channels.div_ceil(CHANNELS_AT_ONCE);
        let size = channels.div_ceil(count).next_multiple_of(LANES);
        let parts: Vec<_> = (0..channels)
            .step_by(size)
            .map(|c| c..(c + size).min(channels))
            .collect();
        let columns = conv.channels_out.next_multiple_of(LANES);
        let mut panels = Aligned::zeros(AREA * channels * columns);
        let width_of = |first: usize| GROUP.min(columns - first);
        for part in &parts {
            for (row, c) in part.clone().enumerate() {
                let Some(channel) = channel_of[c] else {
                    continue;
                };
                for out in 0..conv.channels_out {
                    let kernel = std::array::from_fn(|tap| {
                        f64::from(weight(conv, out, Some((channel, tap))))
                    });
                    let first = out / GROUP * GROUP;
                    for (product, value) in transformed_kernel(&kernel).into_iter().enumerate() {
                        let panel = AREA * part.start * columns
                            + product * part.len() * columns
                            + first * part.len();
                        panels[panel + row * width_of(first) + out - first] = value as f32;
                    }
                }
            }
        }
        let tiles = VALUES_AT_ONCE / (AREA * (size + columns));
        Self {
            bias: padded_bias(conv, columns),
            tiles: (tiles / 6 * 6).max(6),
            geometry,
            parts,
            panels,
        }
    }

    /// # Safety
    /// As for [`crate::direct::Direct::run`].
    pub(crate) unsafe fn run(&self, arena: Shared<f32>) {
        let all = Tiles::new(&self.geometry, OUT).count();
        // The number of tasks is a multiple of the number of threads, which matters if there are few.
        let rounds = all
            .div_ceil(self.tiles)
            .next_multiple_of(rayon::current_num_threads());
        let tiles = all.div_ceil(rounds);
        (0..all.div_ceil(tiles)).into_par_iter().for_each(|task| {
            let tiles = task * tiles..((task + 1) * tiles).min(all);
            with_scratch(|scratch| {
                dispatch(Task {
                    conv: self,
                    arena,
                    inputs: scratch.first.take(AREA * tiles.len() * self.widest()),
                    products: scratch.second.take(AREA * tiles.len() * self.bias.len()),
                    rows: &mut scratch.pixels,
                    tiles,
                });
            });
        });
    }

    /// Number of channels of the widest part.
    fn widest(&self) -> usize {
        self.parts.iter().map(|part| part.len()).max().unwrap_or(0)
    }
}

/// G g Gᵀ.
fn transformed_kernel(g: &[f64; 9]) -> [f64; AREA] {
    let mut out = [0.0; AREA];
    for i in 0..IN {
        for j in 0..IN {
            for y in 0..3 {
                for x in 0..3 {
                    out[i * IN + j] += G[i][y] * g[y * 3 + x] * G[j][x];
                }
            }
        }
    }
    out
}

struct Task<'a> {
    conv: &'a Winograd,
    arena: Shared<'a, f32>,
    tiles: std::ops::Range<usize>,
    /// For each tile: 36 × channels.
    inputs: &'a mut [f32],
    /// For each tile: 36 × output channels.
    products: &'a mut [f32],
    rows: &'a mut Vec<Pixel>,
}

impl WithSimd for Task<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) {
        let Self {
            conv,
            arena,
            tiles: range,
            inputs,
            products,
            rows,
        } = self;
        let (count, columns) = (range.len(), conv.bias.len());
        let places = Tiles::new(&conv.geometry, OUT);
        for (i, part) in conv.parts.iter().enumerate() {
            let size = part.len();
            let input = View {
                offset: conv.geometry.input.offset + part.start,
                channels: size,
                ..conv.geometry.input
            };
            for (t, tile) in range.clone().enumerate() {
                let to = &mut inputs[t * AREA * size..][..AREA * size];
                // SAFETY: nobody writes the input (the contract of `run`).
                unsafe { transform_input(simd, arena, &input, places.of(tile), to) };
            }
            rows.clear();
            rows.extend((0..count).map(|t| Pixel {
                input: inputs[t * AREA * size..].as_ptr(),
                out: products[t * AREA * columns..].as_mut_ptr(),
                residual: std::ptr::null(),
            }));
            for product in 0..AREA {
                for first in (0..columns).step_by(GROUP) {
                    let width = GROUP.min(columns - first);
                    let panel = (AREA * part.start + product * size) * columns + first * size;
                    let shift = Shift {
                        input: product * size,
                        out: product * columns + first,
                    };
                    let sum = Sum {
                        runs: &[0],
                        len: size,
                        panel: conv.panels[panel..].as_ptr(),
                        stride: width,
                        start: if i == 0 { Start::Zero } else { Start::Out },
                        relu: false,
                    };
                    // SAFETY: inputs and products have `count` tiles, and the panel has a row for every channel.
                    unsafe { tiles(simd, &sum, width, rows, shift) };
                }
            }
        }
        for (t, tile) in range.enumerate() {
            let from = &products[t * AREA * columns..][..AREA * columns];
            // SAFETY: each tile of the output belongs to one task.
            unsafe { conv.transform_output(simd, arena, from, places.of(tile)) };
        }
    }
}

/// Bᵀ d B for all channels of a tile whose outputs start at (x, y); product (i, j) of channel c goes to
/// `to[(i·6 + j)·channels + c]`.
///
/// # Safety
/// Nobody may write the view during the call; its channels must be whole vectors.
#[inline(always)]
unsafe fn transform_input<S: Simd>(
    simd: S,
    arena: Shared<f32>,
    view: &View,
    TileOrigin { x, y, step }: TileOrigin,
    to: &mut [f32],
) {
    assert_eq!(to.len(), AREA * view.channels, "a tile's products");
    let to = to.as_mut_ptr();
    // Inputs beyond the border only affect outputs outside the image.
    let column = |i: usize| (x + i * step).min(view.width - 1 + 2 * step) * view.pitch;
    let row = |i: usize| (y + i * step).min(view.height - 1 + 2 * step) * view.row;
    let corner = view.offset - step * (view.row + view.pitch);
    let columns: [usize; IN] = std::array::from_fn(column);
    // Includes the last pixel's last channel, as rows and columns only increase.
    let from = arena.at(corner, row(IN - 1) + columns[IN - 1] + view.channels);
    for c in (0..view.channels).step_by(S::F32_LANES) {
        let zero = simd.splat_f32s(0.0);
        let mut half = [[zero; IN]; IN];
        // SAFETY: the inputs read are in the arena, as was just checked, and nobody writes them (guaranteed by the caller); `to` has room
        // for every product of every channel.
        unsafe {
            for j in 0..IN {
                let d = std::array::from_fn(|i| {
                    let at = from.add(row(i) + columns[j] + c);
                    at.cast::<S::f32s>().read_unaligned()
                });
                let d = input_axis(simd, d);
                for i in 0..IN {
                    half[i][j] = d[i];
                }
            }
            for i in 0..IN {
                let d = input_axis(simd, half[i]);
                for j in 0..IN {
                    to.add((i * IN + j) * view.channels + c)
                        .cast::<S::f32s>()
                        .write_unaligned(d[j]);
                }
            }
        }
    }
}

impl Winograd {
    /// Aᵀ m A with bias, residual and activation, for the pixels of the tile that are in the image.
    ///
    /// # Safety
    /// Nobody else may use those pixels of the output, or write those of the residual.
    #[inline(always)]
    unsafe fn transform_output<S: Simd>(
        &self,
        simd: S,
        arena: Shared<f32>,
        from: &[f32],
        origin @ TileOrigin { x, y, step }: TileOrigin,
    ) {
        let g = &self.geometry;
        let columns = self.bias.len();
        assert_eq!(from.len(), AREA * columns, "a tile's products");
        let from = from.as_ptr();
        let (across, down) = origin.inside(g, OUT);
        if across == 0 || down == 0 {
            return;
        }
        // From the tile's first pixel to the last channel of its last one.
        let tile = |view: &View| {
            let (right, below) = ((across - 1) * step, (down - 1) * step);
            let reach = below * view.row + right * view.pitch;
            arena.at(view.at(x, y), reach + columns)
        };
        let (out, residual) = (tile(&g.out), g.residual.as_ref().map(|r| (r, tile(r))));
        let zero = simd.splat_f32s(0.0);
        for c in (0..columns).step_by(S::F32_LANES) {
            let mut half = [[zero; IN]; OUT];
            // SAFETY: the products have a value for every product of every column, and the bias has one per column; the tile's pixels are
            // in the arena, as was just checked, and nobody else uses them (guaranteed by the caller).
            unsafe {
                let bias = self.bias.as_ptr().add(c).cast::<S::f32s>().read_unaligned();
                for j in 0..IN {
                    let m = std::array::from_fn(|i| {
                        let at = from.add((i * IN + j) * columns + c);
                        at.cast::<S::f32s>().read_unaligned()
                    });
                    let m = output_axis(simd, m);
                    for i in 0..OUT {
                        half[i][j] = m[i];
                    }
                }
                for i in 0..down {
                    let values = output_axis(simd, half[i]);
                    for j in 0..across {
                        let mut value = simd.add_f32s(values[j], bias);
                        let at = |view: &View| step * (i * view.row + j * view.pitch) + c;
                        if let Some((view, r)) = residual {
                            let r = r.add(at(view)).cast::<S::f32s>();
                            value = simd.add_f32s(value, r.read_unaligned());
                        }
                        let value = g.activation.of(simd, value);
                        out.add(at(&g.out)).cast::<S::f32s>().write_unaligned(value);
                    }
                }
            }
        }
    }
}
