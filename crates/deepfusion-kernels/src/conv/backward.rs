use super::{
    ConvShape,
    forward::{Operand, product, rows_of},
    tile::{Tile, tiles},
    unfold::{fold_add, gather_rows, unfold},
};
use crate::{scratch::with_scratch, send_ptr::SharedMut};
use rayon::prelude::*;
use std::ops::Range;

/// Into how many tasks work is cut: a few a thread, so that the last one does not wait alone. A fixed
/// number, so that sums do not depend on the machine.
const TASKS: usize = 8;

/// `total` cut into at most `parts` ranges of nearly equal length.
fn split(total: usize, parts: usize) -> Vec<Range<usize>> {
    let parts = parts.clamp(1, total.max(1));
    (0..parts)
        .map(|i| i * total / parts..(i + 1) * total / parts)
        .collect()
}

/// Whether the tile lies within one image; then its output pixels are contiguous in every channel.
fn in_one_image(shape: &ConvShape, tile: Tile) -> bool {
    tile.rows <= shape.out_height()
}

/// Calls `work` with the tile of `grad_out` as an O × columns operand.
fn with_grad_tile<R>(
    shape: &ConvShape,
    tile: Tile,
    grad_out: &[f32],
    work: impl FnOnce(Operand) -> R,
) -> R {
    let area = shape.out_area();
    if in_one_image(shape, tile) {
        let image = tile.first_row / shape.out_height();
        let offset = (tile.first_row % shape.out_height()) * shape.out_width();
        let from = &grad_out[image * shape.out_channels * area..][..shape.out_channels * area];
        return work(Operand {
            pointer: from[offset..].as_ptr(),
            row_stride: area,
            column_stride: 1,
        });
    }
    let columns = tile.columns(shape);
    with_scratch(shape.out_channels * columns, |matrix| {
        gather_rows(shape, tile, grad_out, shape.out_channels, matrix);
        work(rows_of(matrix, columns))
    })
}

/// ∂L/∂X = fold(Wᵀ·∂L/∂Y).
///
/// # Shapes
/// `weight` O×C×kh×kw, `grad_out` N×O×H_out×W_out, `grad_x` N×C×H×W, overwritten.
///
/// # Panics
/// When a length does not fit `shape`.
pub fn conv2d_backward_input(
    shape: &ConvShape,
    weight: &[f32],
    grad_out: &[f32],
    grad_x: &mut [f32],
) {
    shape.check();
    assert_eq!(weight.len(), shape.weight_len(), "weight length");
    assert_eq!(grad_out.len(), shape.out_len(), "output gradient length");
    assert_eq!(grad_x.len(), shape.in_len(), "input gradient length");
    if grad_x.is_empty() {
        return;
    }
    let area = shape.kernel_area();
    // Where the tiles hold several images, a task takes a group of channels of all of them.
    let image_groups = if shape.out_area() < 192 {
        split(shape.batch, 1)
    } else {
        split(shape.batch, TASKS)
    };
    let channel_groups = split(shape.in_channels, TASKS.div_ceil(image_groups.len()));
    let to = SharedMut::new(grad_x);
    let tasks: Vec<_> = image_groups
        .iter()
        .flat_map(|images| {
            channel_groups
                .iter()
                .map(move |c| (images.clone(), c.clone()))
        })
        .collect();
    tasks.into_par_iter().for_each(|(images, channels)| {
        let start_of = |n: usize| (n * shape.in_channels + channels.start) * shape.in_area();
        let group_len = channels.len() * shape.in_area();
        let taps = channels.len() * area;
        // Wᵀ of the group's taps: a taps × O operand over the O×K weights.
        let weights = Operand {
            pointer: weight[channels.start * area..].as_ptr(),
            row_stride: 1,
            column_stride: shape.taps(),
        };
        if !shape.is_pointwise() {
            for n in images.clone() {
                // SAFETY: this task alone has these images and channels.
                unsafe { to.slice(start_of(n), group_len) }.fill(0.0);
            }
        }
        for tile in tiles(shape, taps, images.start, images.end) {
            let columns = tile.columns(shape);
            with_grad_tile(shape, tile, grad_out, |grad| {
                let sizes = (taps, columns, shape.out_channels);
                if shape.is_pointwise() && in_one_image(shape, tile) {
                    let n = tile.first_row / shape.out_height();
                    let offset = (tile.first_row % shape.out_height()) * shape.out_width();
                    // SAFETY: written once, by this task; sizes are the shape's.
                    unsafe {
                        let to = to.at(start_of(n) + offset);
                        product(sizes, to, (shape.in_area(), 1), false, weights, grad);
                    }
                    return;
                }
                if shape.is_pointwise() {
                    for n in tile.pieces(shape).map(|p| p.image) {
                        // SAFETY: as above.
                        unsafe { to.slice(start_of(n), group_len) }.fill(0.0);
                    }
                }
                with_scratch(taps * columns, |matrix| {
                    // SAFETY: the matrix is this thread's own; sizes are the shape's.
                    unsafe {
                        product(
                            sizes,
                            matrix.as_mut_ptr(),
                            (columns, 1),
                            false,
                            weights,
                            grad,
                        );
                    }
                    // SAFETY: this task alone has these images and channels.
                    fold_add(shape, tile, channels.len(), matrix, |n| unsafe {
                        to.slice(start_of(n), group_len).as_mut_ptr()
                    });
                });
            });
        }
    });
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
    if shape.out_len() == 0 {
        grad_weight.fill(0.0);
        return;
    }
    if shape.in_channels >= TASKS {
        let to = SharedMut::new(grad_weight);
        split(shape.in_channels, TASKS)
            .into_par_iter()
            .for_each(|channels| {
                let all = tiles(shape, channels.len() * shape.kernel_area(), 0, shape.batch);
                accumulate_weight(shape, &all, channels, x, grad_out, &to);
            });
        return;
    }
    // Few input channels (the first layer): split the pixels instead, and sum the parts in order.
    let all = tiles(shape, shape.taps(), 0, shape.batch);
    let mut parts: Vec<(Range<usize>, Vec<f32>)> = split(all.len(), TASKS)
        .into_iter()
        .map(|range| (range, vec![0.0; shape.weight_len()]))
        .collect();
    parts.par_iter_mut().for_each(|(range, part)| {
        let to = SharedMut::new(part);
        let channels = 0..shape.in_channels;
        accumulate_weight(shape, &all[range.clone()], channels, x, grad_out, &to);
    });
    grad_weight.fill(0.0);
    for (_, part) in &parts {
        for (sum, add) in grad_weight.iter_mut().zip(part) {
            *sum += *add;
        }
    }
}

/// The weight gradient of `channels` summed over `tiles`, into the columns of `to` (O×K) that belong
/// to them.
///
/// The sum is kept as its transpose, K×O: then the product packs the output gradient and streams the
/// unfolded input, which is kh·kw times larger, as it lies.
fn accumulate_weight(
    shape: &ConvShape,
    tiles: &[Tile],
    channels: Range<usize>,
    x: &[f32],
    grad_out: &[f32],
    to: &SharedMut<f32>,
) {
    let taps = channels.len() * shape.kernel_area();
    let outputs = shape.out_channels;
    with_scratch(taps * outputs, |sum| {
        sum.fill(0.0);
        for &tile in tiles {
            let columns = tile.columns(shape);
            with_grad_tile(shape, tile, grad_out, |grad| {
                let mut add = |unfolded: Operand| {
                    let transposed = Operand {
                        row_stride: unfolded.column_stride,
                        column_stride: unfolded.row_stride,
                        ..unfolded
                    };
                    // SAFETY: the sum is this thread's own; sizes are the shape's.
                    unsafe {
                        let sizes = (outputs, taps, columns);
                        product(
                            sizes,
                            sum.as_mut_ptr(),
                            (1, outputs),
                            true,
                            grad,
                            transposed,
                        );
                    }
                };
                if shape.is_pointwise() && in_one_image(shape, tile) {
                    let image = tile.first_row / shape.out_height();
                    let offset = (tile.first_row % shape.out_height()) * shape.out_width();
                    let start = (image * shape.in_channels + channels.start) * shape.in_area();
                    add(Operand {
                        pointer: x[start + offset..].as_ptr(),
                        row_stride: shape.in_area(),
                        column_stride: 1,
                    });
                    return;
                }
                with_scratch(taps * columns, |matrix| {
                    unfold(shape, tile, channels.clone(), x, matrix);
                    add(rows_of(matrix, columns));
                });
            });
        }
        for output in 0..outputs {
            let start = output * shape.taps() + channels.start * shape.kernel_area();
            // SAFETY: the taps of these channels are written by this task alone.
            let row = unsafe { to.slice(start, taps) };
            for (tap, value) in row.iter_mut().enumerate() {
                *value = sum[tap * outputs + output];
            }
        }
    });
}
