use super::{
    ConvShape,
    forward::gather,
    lattice::{Lattice, Tile, tiles},
    product::{PixelProduct, padded},
    transpose::transpose,
};
use crate::{scratch::with_scratch, send_ptr::SharedMut};
use rayon::prelude::*;
use std::ops::Range;

/// Into how many tasks work is cut: a few a thread, so that the last one does not wait alone. A fixed
/// number, so that sums do not depend on the machine.
const TASKS: usize = 8;
/// Weights up to which every task sums all of them over its own tiles; above, every task sums a group
/// of channels over all tiles.
const FEW_WEIGHTS: usize = 1 << 16;

/// `total` cut into at most `parts` ranges of nearly equal length.
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
/// When a length does not fit `shape`.
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
    let to = SharedMut::new(grad_weight);
    if shape.weight_len() > FEW_WEIGHTS && shape.in_channels >= TASKS {
        split(shape.in_channels, TASKS)
            .into_par_iter()
            .for_each(|channels| {
                let mut sum = vec![0.0; sum_len(shape, &channels)];
                add_tiles(shape, &tiles, channels.clone(), x, grad_out, &mut sum);
                write(shape, channels, &sum, &to);
            });
        return;
    }
    let channels = 0..shape.in_channels;
    let mut parts: Vec<Vec<f32>> = split(tiles.len(), TASKS)
        .into_par_iter()
        .map(|range| {
            let mut sum = vec![0.0; sum_len(shape, &channels)];
            let tiles = &tiles[range];
            add_tiles(shape, tiles, channels.clone(), x, grad_out, &mut sum);
            sum
        })
        .collect();
    let mut total = parts.swap_remove(0);
    for part in &parts {
        for (sum, add) in total.iter_mut().zip(part) {
            *sum += *add;
        }
    }
    write(shape, channels, &total, &to);
}

/// Length of the transposed sum of some channels' taps: taps × padded outputs.
fn sum_len(shape: &ConvShape, channels: &Range<usize>) -> usize {
    channels.len() * shape.kernel_area() * padded(shape.out_channels)
}

/// Adds the weight gradient of `channels` over `tiles` to its transpose, taps × outputs.
fn add_tiles(
    shape: &ConvShape,
    tiles: &[Tile],
    channels: Range<usize>,
    x: &[f32],
    grad_out: &[f32],
    sum: &mut [f32],
) {
    let outputs = padded(shape.out_channels);
    let (area, width) = (shape.out_area(), shape.out_width());
    let mut layout: Option<(Tile, Vec<usize>, Vec<usize>)> = None;
    for tile in tiles {
        let lattice = Lattice::new(shape.window(), *tile);
        let same = |t: &Tile| (t.images, t.rows) == (tile.images, tile.rows);
        if !layout.as_ref().is_some_and(|(t, ..)| same(t)) {
            let offsets = shape.tap_offsets(&lattice, 0..channels.len());
            layout = Some((*tile, offsets, lattice.pixels()));
        }
        let Some((_, offsets, pixels)) = &layout else {
            continue;
        };
        let source_len = channels.len() * lattice.plane_len;
        with_scratch(source_len + pixels.len() * outputs, |buffer| {
            let (source, grad) = buffer.split_at_mut(source_len);
            gather(&lattice, x, shape.in_channels, channels.clone(), source);
            let count = tile.rows * width;
            for (n, grad) in grad.chunks_exact_mut(count * outputs).enumerate() {
                let first = (tile.first_image + n) * shape.out_channels * area;
                let from = &grad_out[first + tile.first_row * width..];
                transpose(from, area, shape.out_channels, count, grad, outputs);
            }
            PixelProduct {
                offsets,
                source,
                pixels,
                grad,
                columns: outputs,
                out: &mut *sum,
            }
            .run();
        });
    }
}

/// Writes the transposed sum of `channels` to their weights.
fn write(shape: &ConvShape, channels: Range<usize>, sum: &[f32], to: &SharedMut<f32>) {
    let taps = channels.len() * shape.kernel_area();
    let stride = padded(shape.out_channels);
    for output in 0..shape.out_channels {
        let start = output * shape.taps() + channels.start * shape.kernel_area();
        // SAFETY: the taps of these channels are written by this task alone.
        let row = unsafe { to.slice(start, taps) };
        for (value, sums) in row.iter_mut().zip(sum.chunks_exact(stride)) {
            *value = sums[output];
        }
    }
}
