use super::{
    ConvShape,
    tile::{Tile, tiles},
    unfold::unfold,
};
use crate::{scratch::with_scratch, send_ptr::SharedMut};
use rayon::prelude::*;

/// A row-major matrix operand: pointer, row stride, column stride.
#[derive(Clone, Copy)]
pub(super) struct Operand {
    pub(super) pointer: *const f32,
    pub(super) row_stride: usize,
    pub(super) column_stride: usize,
}

/// `to (m×n) = a (m×k) · b (k×n)`, or `+=` with `accumulate`, on this thread. `to` is given by the
/// distances between its rows and between its columns.
///
/// # Safety
/// All operands must be in bounds, and `to` must not be written by anyone else.
pub(super) unsafe fn product(
    (m, n, k): (usize, usize, usize),
    to: *mut f32,
    (to_row_stride, to_column_stride): (usize, usize),
    accumulate: bool,
    a: Operand,
    b: Operand,
) {
    let stride = |s: usize| isize::try_from(s).unwrap_or(isize::MAX);
    // SAFETY: the caller's promise.
    unsafe {
        gemm::gemm(
            m,
            n,
            k,
            to,
            stride(to_column_stride),
            stride(to_row_stride),
            accumulate,
            a.pointer,
            stride(a.column_stride),
            stride(a.row_stride),
            b.pointer,
            stride(b.column_stride),
            stride(b.row_stride),
            1.0,
            1.0,
            false,
            false,
            false,
            gemm::Parallelism::None,
        );
    }
}

/// Y = W ⋆ X + b.
///
/// # Shapes
/// `x` N×C×H×W, `weight` O×C×kh×kw, `bias` O, `out` N×O×H_out×W_out.
///
/// # Panics
/// When a length does not fit `shape`, or reflection padding is as large as the image.
pub fn conv2d(shape: &ConvShape, x: &[f32], weight: &[f32], bias: Option<&[f32]>, out: &mut [f32]) {
    shape.check();
    assert_eq!(x.len(), shape.in_len(), "input length");
    assert_eq!(weight.len(), shape.weight_len(), "weight length");
    assert_eq!(out.len(), shape.out_len(), "output length");
    assert!(
        bias.is_none_or(|b| b.len() == shape.out_channels),
        "bias length"
    );
    if out.is_empty() {
        return;
    }
    let out = SharedMut::new(out);
    tiles(shape, shape.taps(), 0, shape.batch)
        .into_par_iter()
        .for_each(|tile| forward_tile(shape, tile, x, weight, bias, &out));
}

fn forward_tile(
    shape: &ConvShape,
    tile: Tile,
    x: &[f32],
    weight: &[f32],
    bias: Option<&[f32]>,
    out: &SharedMut<f32>,
) {
    let (taps, area, width) = (shape.taps(), shape.out_area(), shape.out_width());
    let (columns, channels) = (tile.columns(shape), shape.out_channels);
    let single = tile.rows <= shape.out_height();
    let image = tile.first_row / shape.out_height();
    let offset = (tile.first_row % shape.out_height()) * width;
    let weights = Operand {
        pointer: weight.as_ptr(),
        row_stride: taps,
        column_stride: 1,
    };

    let multiply = |b: Operand, to: *mut f32, to_row_stride: usize| {
        // SAFETY: `to` is this tile's columns, which no other tile has; the operands' sizes are those
        // of the shape, checked against the slices' lengths above.
        unsafe {
            product(
                (channels, columns, taps),
                to,
                (to_row_stride, 1),
                false,
                weights,
                b,
            );
        }
    };
    let add_bias = |row: &mut [f32], channel: usize| {
        if let Some(bias) = bias {
            row.iter_mut().for_each(|v| *v += bias[channel]);
        }
    };

    if single {
        // SAFETY: rows of this tile only; the start is within the output.
        let to = unsafe { out.at(image * channels * area + offset) };
        if shape.is_pointwise() {
            let from = &x[image * shape.in_channels * area..][..shape.in_channels * area];
            multiply(
                Operand {
                    pointer: from[offset..].as_ptr(),
                    row_stride: area,
                    column_stride: 1,
                },
                to,
                area,
            );
        } else {
            with_scratch(taps * columns, |matrix| {
                unfold(shape, tile, 0..shape.in_channels, x, matrix);
                multiply(rows_of(matrix, columns), to, area);
            });
        }
        if bias.is_some() {
            for channel in 0..channels {
                let start = (image * channels + channel) * area + offset;
                // SAFETY: this tile's columns of one channel.
                add_bias(unsafe { out.slice(start, columns) }, channel);
            }
        }
        return;
    }
    with_scratch((taps + channels) * columns, |buffer| {
        let (matrix, result) = buffer.split_at_mut(taps * columns);
        unfold(shape, tile, 0..shape.in_channels, x, matrix);
        multiply(rows_of(matrix, columns), result.as_mut_ptr(), columns);
        for piece in tile.pieces(shape) {
            for channel in 0..channels {
                let start = (piece.image * channels + channel) * area + piece.y * width;
                let len = piece.rows * width;
                // SAFETY: this tile's rows of one image and channel.
                let to = unsafe { out.slice(start, len) };
                to.copy_from_slice(&result[channel * columns + piece.column..][..len]);
                add_bias(to, channel);
            }
        }
    });
}

/// A row-major matrix with `columns` columns.
pub(super) fn rows_of(matrix: &[f32], columns: usize) -> Operand {
    Operand {
        pointer: matrix.as_ptr(),
        row_stride: columns,
        column_stride: 1,
    }
}
