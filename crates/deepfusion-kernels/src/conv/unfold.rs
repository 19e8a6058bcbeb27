use super::{
    ConvShape,
    tile::{Piece, Tile},
};
use std::ops::Range;

/// Where a tap reads on one axis: the input index of output position `out` and kernel tap `tap`;
/// `None` in zero padding.
fn source(shape: &ConvShape, out: usize, tap: usize, size: usize) -> Option<usize> {
    let position = out * shape.stride + tap * shape.dilation;
    if position >= shape.padding && position - shape.padding < size {
        return Some(position - shape.padding);
    }
    if !shape.reflect {
        return None;
    }
    Some(if position < shape.padding {
        shape.padding - position
    } else {
        2 * (size - 1) - (position - shape.padding)
    })
}

/// Output columns whose source lies inside the image, for kernel column `tap`: there the source is
/// `out * stride + tap * dilation - padding`, without branches.
fn inside(shape: &ConvShape, tap: usize) -> Range<usize> {
    let shift = tap * shape.dilation;
    let first = shape.padding.saturating_sub(shift).div_ceil(shape.stride);
    // out * stride + shift - padding <= W - 1
    let last = (shape.in_width + shape.padding)
        .checked_sub(shift + 1)
        .map_or(0, |room| room / shape.stride + 1);
    let last = last.min(shape.out_width());
    first.min(last)..last
}

/// Calls `visit(matrix row, column in the tile, input row offset or None, kernel column)` for every
/// row segment of the unfolded matrix. The input row offset is within one image.
fn segments(
    shape: &ConvShape,
    piece: &Piece,
    channels: Range<usize>,
    mut visit: impl FnMut(usize, usize, Option<usize>, usize),
) {
    let mut row = 0;
    for channel in channels {
        for ky in 0..shape.kernel_height {
            for kx in 0..shape.kernel_width {
                for y in 0..piece.rows {
                    let input_row = source(shape, piece.y + y, ky, shape.in_height)
                        .map(|iy| channel * shape.in_area() + iy * shape.in_width);
                    visit(row, piece.column + y * shape.out_width(), input_row, kx);
                }
                row += 1;
            }
        }
    }
}

/// Unfolds the tile's input for `channels`: `matrix` is (channels·kh·kw) × columns.
pub(crate) fn unfold(
    shape: &ConvShape,
    tile: Tile,
    channels: Range<usize>,
    x: &[f32],
    matrix: &mut [f32],
) {
    let columns = tile.columns(shape);
    let out_width = shape.out_width();
    let image_len = shape.in_channels * shape.in_area();
    for piece in tile.pieces(shape) {
        let image = &x[piece.image * image_len..(piece.image + 1) * image_len];
        segments(
            shape,
            &piece,
            channels.clone(),
            |row, column, input_row, kx| {
                let to = &mut matrix[row * columns + column..][..out_width];
                let Some(input_row) = input_row else {
                    to.fill(0.0);
                    return;
                };
                let from = &image[input_row..input_row + shape.in_width];
                let inner = inside(shape, kx);
                for out in (0..inner.start).chain(inner.end..out_width) {
                    to[out] = source(shape, out, kx, shape.in_width).map_or(0.0, |ix| from[ix]);
                }
                if inner.is_empty() {
                    return;
                }
                let start = inner.start * shape.stride + kx * shape.dilation - shape.padding;
                let to = &mut to[inner];
                if shape.stride == 1 {
                    to.copy_from_slice(&from[start..start + to.len()]);
                } else {
                    for (value, read) in to
                        .iter_mut()
                        .zip(from[start..].iter().step_by(shape.stride))
                    {
                        *value = *read;
                    }
                }
            },
        );
    }
}

/// The adjoint of [`unfold`]: adds the matrix back onto `image_of(n)`, the gradient of image n
/// restricted to `channels` (C_group×H×W).
pub(crate) fn fold_add(
    shape: &ConvShape,
    tile: Tile,
    channels: usize,
    matrix: &[f32],
    mut image_of: impl FnMut(usize) -> *mut f32,
) {
    let columns = tile.columns(shape);
    let out_width = shape.out_width();
    for piece in tile.pieces(shape) {
        // SAFETY: the caller hands out a buffer of channels·H·W values that only this task writes.
        let image = unsafe {
            std::slice::from_raw_parts_mut(image_of(piece.image), channels * shape.in_area())
        };
        segments(shape, &piece, 0..channels, |row, column, input_row, kx| {
            let Some(input_row) = input_row else { return };
            let from = &matrix[row * columns + column..][..out_width];
            let to = &mut image[input_row..input_row + shape.in_width];
            let inner = inside(shape, kx);
            for out in (0..inner.start).chain(inner.end..out_width) {
                if let Some(ix) = source(shape, out, kx, shape.in_width) {
                    to[ix] += from[out];
                }
            }
            if inner.is_empty() {
                return;
            }
            let start = inner.start * shape.stride + kx * shape.dilation - shape.padding;
            let from = &from[inner];
            if shape.stride == 1 {
                for (sum, add) in to[start..start + from.len()].iter_mut().zip(from) {
                    *sum += *add;
                }
            } else {
                for (sum, add) in to[start..].iter_mut().step_by(shape.stride).zip(from) {
                    *sum += *add;
                }
            }
        });
    }
}

/// Copies the tile of an N×O×P tensor into an O × columns matrix.
pub(crate) fn gather_rows(
    shape: &ConvShape,
    tile: Tile,
    tensor: &[f32],
    channels: usize,
    matrix: &mut [f32],
) {
    let (columns, area, width) = (tile.columns(shape), shape.out_area(), shape.out_width());
    for piece in tile.pieces(shape) {
        for channel in 0..channels {
            let from = (piece.image * channels + channel) * area + piece.y * width;
            let to = channel * columns + piece.column;
            let len = piece.rows * width;
            matrix[to..to + len].copy_from_slice(&tensor[from..from + len]);
        }
    }
}
