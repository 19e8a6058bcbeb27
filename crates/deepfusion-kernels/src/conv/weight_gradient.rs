use super::{
    ConvShape,
    arithmetic::Arithmetic,
    bf16::{self, PixelPairs, Unit},
    few_outputs,
    lattice::{Lattice, Tile, gather_channels, tiles},
    product::{LANES, PixelProduct, padded},
    transpose::transpose,
    winograd::{Image, WeightGradient},
};
use crate::{scratch::with_scratch, send_ptr::SharedMut};
use pulp::bytemuck::{cast_slice, cast_slice_mut};
use rayon::prelude::*;
use std::ops::Range;

/// Number of tasks: a few per thread, so that threads finish at about the same time. It is fixed, so that sums do not depend on the
/// machine.
const TASKS: usize = 8;
/// Up to this number of weights, every task sums all of them over its own tiles; above, every task sums a group of channels over all tiles.
const FEW_WEIGHTS: usize = 1 << 16;

/// `total` divided into at most `parts` ranges of nearly equal length.
fn split(total: usize, parts: usize) -> Vec<Range<usize>> {
    let parts = parts.clamp(1, total.max(1));
    (0..parts)
        .map(|i| i * total / parts..(i + 1) * total / parts)
        .collect()
}

/// ∂L/∂W = ∂L/∂Y·Xᵀ.
///
/// # Shapes
/// `x` N×C×H×W, `grad_out` N×O×H_out×W_out, `grad_weight` O×C×kh×kw, overwritten.
///
/// # Panics
/// If a length does not match `shape`.
pub fn conv2d_backward_weight(
    shape: &ConvShape,
    x: &[f32],
    grad_out: &[f32],
    grad_weight: &mut [f32],
) {
    shape.check();
    assert_eq!(x.len(), shape.in_len(), "input length");
    assert_eq!(grad_out.len(), shape.out_len(), "output gradient length");
    assert_eq!(
        grad_weight.len(),
        shape.weight_len(),
        "weight gradient length"
    );
    if shape.out_len() == 0 || shape.in_len() == 0 {
        grad_weight.fill(0.0);
        return;
    }
    let row_floats = shape.in_channels * shape.stride * (shape.in_width + 2 * shape.padding)
        + padded(shape.out_channels) * shape.out_width();
    let tiles = tiles(shape.batch, 0, shape.out_height(), row_floats);
    if shape.out_channels < few_outputs::FEW {
        let add =
            |_: &mut (), tile, sum: &mut [f32]| few_outputs::add(shape, tile, x, grad_out, sum);
        grad_weight.copy_from_slice(&sum_over(&tiles, shape.weight_len(), || (), add));
        return;
    }
    let winograd = winograd(shape, x, grad_out);
    if shape.is_plain_3x3() && winograd.is_faster() {
        let many = shape.weight_len() > FEW_WEIGHTS && shape.in_channels >= TASKS;
        return by_winograd(shape, &winograd, many, grad_weight);
    }
    let arithmetic = Arithmetic::of(shape);
    let to = SharedMut::new(grad_weight);
    let all = 0..shape.in_channels;
    // For products of pairs, groups must be whole tiles of channels.
    let step = match arithmetic {
        Arithmetic::Single => 1,
        Arithmetic::Pairs(_) => bf16::ROWS,
    };
    if shape.weight_len() > FEW_WEIGHTS && shape.in_channels >= TASKS * step {
        // Every group of channels needs the transposed gradient of all tiles, so it is computed once.
        let len = |tile: &Tile| grad_len(shape, arithmetic, tile);
        with_scratch(tiles.iter().map(len).sum(), |grads| {
            let mut rest = grads;
            let mut parts = Vec::new();
            for tile in &tiles {
                let (part, after) = rest.split_at_mut(len(tile));
                parts.push((tile, part));
                rest = after;
            }
            parts.par_iter_mut().for_each(|(tile, part)| {
                transposed_grad(shape, arithmetic, tile, grad_out, part);
            });
            let parts: Vec<(Tile, &[f32])> = parts.into_iter().map(|(t, p)| (*t, &*p)).collect();
            split(shape.in_channels / step, TASKS)
                .into_par_iter()
                .map(|group| group.start * step..group.end * step)
                .for_each(|channels| {
                    let mut sum = vec![0.0; sum_len(shape, &channels)];
                    let mut adder = Adder::new(arithmetic);
                    for (tile, grad) in &parts {
                        adder.add(shape, *tile, channels.clone(), x, grad, &mut sum);
                    }
                    write(shape, channels, &sum, &to);
                });
        });
        return;
    }
    let total = sum_over(
        &tiles,
        sum_len(shape, &all),
        || Adder::new(arithmetic),
        |adder, tile, sum| {
            with_scratch(grad_len(shape, arithmetic, &tile), |grad| {
                transposed_grad(shape, arithmetic, &tile, grad_out, grad);
                adder.add(shape, tile, all.clone(), x, grad, sum);
            });
        },
    );
    write(shape, all.clone(), &total, &to);
}

/// The gradient of 3×3 kernels with a margin of one pixel, in Winograd's form.
pub(super) fn winograd<'a>(
    shape: &ConvShape,
    x: &'a [f32],
    grad_out: &'a [f32],
) -> WeightGradient<'a> {
    WeightGradient {
        source: Image::of(shape, x),
        grad_out,
        outputs: shape.out_channels,
        out: (shape.out_height(), shape.out_width()),
    }
}

/// With `many` weights, every task sums a group of channels over all tiles, else all weights over its own tiles.
pub(super) fn by_winograd(
    shape: &ConvShape,
    gradient: &WeightGradient<'_>,
    many: bool,
    grad_weight: &mut [f32],
) {
    let to = SharedMut::new(grad_weight);
    if many {
        let groups = split(shape.in_channels, TASKS);
        return gradient.by_channels(groups, |channels, sum| write(shape, channels, sum, &to));
    }
    let parts = gradient.parts();
    let sums: Vec<Vec<f32>> = split(parts.len(), TASKS)
        .into_par_iter()
        .map(|range| {
            let mut sum = vec![0.0; gradient.sum_len(shape.in_channels)];
            gradient.over(&parts[range], &mut sum);
            sum
        })
        .collect();
    write(shape, 0..shape.in_channels, &total(sums), &to);
}

/// The `len` sums over all tiles; `add` adds those of one tile. Every task has its own state.
fn sum_over<S>(
    tiles: &[Tile],
    len: usize,
    state: impl Fn() -> S + Sync,
    add: impl Fn(&mut S, Tile, &mut [f32]) + Sync,
) -> Vec<f32> {
    let parts: Vec<Vec<f32>> = split(tiles.len(), TASKS)
        .into_par_iter()
        .map(|range| {
            let (mut state, mut sum) = (state(), vec![0.0; len]);
            for tile in &tiles[range] {
                add(&mut state, *tile, &mut sum);
            }
            sum
        })
        .collect();
    total(parts)
}

/// The sum of at least one part, in order.
fn total(mut parts: Vec<Vec<f32>>) -> Vec<f32> {
    let mut total = parts.swap_remove(0);
    for part in &parts {
        for (sum, add) in total.iter_mut().zip(part) {
            *sum += *add;
        }
    }
    total
}

/// Number of pixels of a tile, as products of pairs sum them: all columns, including those between rows.
fn columns(shape: &ConvShape, tile: &Tile) -> usize {
    let lattice = Lattice::new(shape.window(), *tile);
    lattice.columns().next_multiple_of(bf16::COLUMNS)
}

/// Words of a tile's transposed gradient: pixels × padded outputs, or pairs of columns × outputs.
fn grad_len(shape: &ConvShape, arithmetic: Arithmetic, tile: &Tile) -> usize {
    match arithmetic {
        Arithmetic::Single => {
            tile.images * tile.rows * shape.out_width() * padded(shape.out_channels)
        }
        Arithmetic::Pairs(_) => columns(shape, tile) / 2 * shape.out_channels,
    }
}

/// The output gradient of a tile with interleaved outputs.
fn transposed_grad(
    shape: &ConvShape,
    arithmetic: Arithmetic,
    tile: &Tile,
    grad_out: &[f32],
    to: &mut [f32],
) {
    if matches!(arithmetic, Arithmetic::Pairs(_)) {
        return transposed_pairs(shape, tile, grad_out, cast_slice_mut(to));
    }
    let outputs = padded(shape.out_channels);
    let (area, width) = (shape.out_area(), shape.out_width());
    let count = tile.rows * width;
    for (n, to) in to.chunks_exact_mut(count * outputs).enumerate() {
        let first = (tile.first_image + n) * shape.out_channels * area;
        let from = &grad_out[first + tile.first_row * width..];
        transpose(from, area, shape.out_channels, count, to, outputs);
    }
}

/// Words of two neighbouring columns × outputs; zero in columns that are not pixels.
fn transposed_pairs(shape: &ConvShape, tile: &Tile, grad_out: &[f32], to: &mut [u32]) {
    let lattice = Lattice::new(shape.window(), *tile);
    let (outputs, pairs) = (shape.out_channels, columns(shape, tile) / 2);
    let (area, width) = (shape.out_area(), shape.out_width());
    with_scratch(outputs * pairs, |rows| {
        rows.fill(0.0);
        let halves = cast_slice_mut::<f32, u16>(rows).chunks_exact_mut(2 * pairs);
        for (output, halves) in halves.enumerate() {
            for image in 0..tile.images {
                let plane = ((tile.first_image + image) * outputs + output) * area;
                for row in 0..tile.rows {
                    let from = &grad_out[plane + (tile.first_row + row) * width..][..width];
                    bf16::planar(from, &mut halves[lattice.column(image, row)..][..width]);
                }
            }
        }
        transpose(cast_slice(rows), pairs, outputs, pairs, to, outputs);
    });
}

/// Length of the transposed sum of some channels' taps: taps × padded outputs.
fn sum_len(shape: &ConvShape, channels: &Range<usize>) -> usize {
    channels.len() * shape.kernel_area() * padded(shape.out_channels)
}

/// Sums weight gradients over tiles, and keeps the offsets, which tiles of the same size share.
struct Adder {
    arithmetic: Arithmetic,
    layout: Option<Layout>,
}

struct Layout {
    images: usize,
    rows: usize,
    /// Offsets of the taps, of all channels or, for pairs, of the first one.
    taps: Vec<usize>,
    /// Offsets of the pixels; unused for pairs, which sum all columns.
    pixels: Vec<usize>,
}

impl Adder {
    fn new(arithmetic: Arithmetic) -> Self {
        Self {
            arithmetic,
            layout: None,
        }
    }

    /// Adds the weight gradient of `channels` over a tile to its transpose, taps × outputs.
    fn add(
        &mut self,
        shape: &ConvShape,
        tile: Tile,
        channels: Range<usize>,
        x: &[f32],
        grad: &[f32],
        sum: &mut [f32],
    ) {
        let lattice = Lattice::new(shape.window(), tile);
        let same = |l: &Layout| (l.images, l.rows) == (tile.images, tile.rows);
        let layout = self.layout.take().filter(same);
        let layout = layout.unwrap_or_else(|| self.layout(shape, tile, &lattice, channels.len()));
        match self.arithmetic {
            Arithmetic::Single => with_scratch(channels.len() * lattice.plane_len, |source| {
                gather_channels(&lattice, x, shape.in_channels, channels, source);
                PixelProduct {
                    offsets: &layout.taps,
                    source,
                    pixels: &layout.pixels,
                    grad,
                    columns: padded(shape.out_channels),
                    out: sum,
                }
                .run();
            }),
            Arithmetic::Pairs(unit) => add_pairs(
                shape,
                unit,
                (&lattice, &layout.taps),
                channels,
                x,
                cast_slice(grad),
                sum,
            ),
        }
        self.layout = Some(layout);
    }

    fn layout(&self, shape: &ConvShape, tile: Tile, lattice: &Lattice, channels: usize) -> Layout {
        let single = self.arithmetic == Arithmetic::Single;
        Layout {
            images: tile.images,
            rows: tile.rows,
            taps: shape.tap_offsets(lattice, 0..if single { channels } else { 1 }),
            pixels: if single { lattice.pixels() } else { Vec::new() },
        }
    }
}

fn add_pairs(
    shape: &ConvShape,
    unit: Unit,
    (lattice, taps): (&Lattice, &[usize]),
    channels: Range<usize>,
    x: &[f32],
    grad: &[u32],
    sum: &mut [f32],
) {
    let (area, len) = (lattice.image_area(), lattice.plane_len);
    with_scratch((channels.len() * len).div_ceil(2), |words| {
        let source = &mut cast_slice_mut::<f32, u16>(words)[..channels.len() * len];
        for (channel, plane) in channels.clone().zip(source.chunks_exact_mut(len)) {
            let image = |n: usize| &x[(n * shape.in_channels + channel) * area..][..area];
            lattice.gather_halves(image, plane);
        }
        PixelPairs {
            offsets: taps,
            plane_len: len,
            channels: channels.len(),
            source,
            pixels: lattice.columns().next_multiple_of(bf16::COLUMNS),
            grad,
            outputs: shape.out_channels,
            out: sum,
        }
        .run(unit);
    });
}

/// Writes the transposed sum of `channels` to their weights.
fn write(shape: &ConvShape, channels: Range<usize>, sum: &[f32], to: &SharedMut<f32>) {
    let taps = channels.len() * shape.kernel_area();
    let start = channels.start * shape.kernel_area();
    let stride = padded(shape.out_channels);
    for first in (0..shape.out_channels).step_by(LANES) {
        let count = LANES.min(shape.out_channels - first);
        // A vector of the sum goes to as many rows, all of which stay in the cache.
        let mut rows: Vec<&mut [f32]> = (first..first + count)
            // SAFETY: only this task writes the taps of these channels, each row once.
            .map(|output| unsafe { to.slice(output * shape.taps() + start, taps) })
            .collect();
        for (tap, sums) in sum.chunks_exact(stride).enumerate() {
            for (row, value) in rows.iter_mut().zip(&sums[first..]) {
                row[tap] = *value;
            }
        }
    }
}
