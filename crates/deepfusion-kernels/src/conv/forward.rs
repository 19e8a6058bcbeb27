use super::{
    ConvShape,
    arithmetic::{Arithmetic, Product, Weights},
    lattice::{Lattice, Tile, tiles},
    winograd::{self, Image, Kernels},
};
use crate::{
    scratch::with_scratch,
    send_ptr::SharedMut,
    slot::{Slot, filled, room},
};
use rayon::prelude::*;
use std::mem::MaybeUninit;
use std::ops::Range;

/// If there are fewer tasks, the output channels of a tile are also divided among tasks, so that no core is idle.
const TASKS: usize = 4;

/// Pairs every tile with every group of channels. The size of a group is a multiple of `step`, except for the last. There are several
/// groups only if there are few tiles.
pub(super) fn tasks(tiles: &[Tile], channels: usize, step: usize) -> Vec<(Tile, Range<usize>)> {
    let groups = TASKS.div_ceil(tiles.len().max(1));
    let most = channels.div_ceil(groups).next_multiple_of(step);
    let mut tasks = Vec::new();
    for tile in tiles {
        for first in (0..channels).step_by(most) {
            tasks.push((*tile, first..(first + most).min(channels)));
        }
    }
    tasks
}

/// Y = W ⋆ X + b.
///
/// # Shapes
/// `x` N×C×H×W, `weight` O×C×kh×kw, `bias` O, `out` N×O×H_out×W_out.
///
/// # Panics
/// If a length does not match `shape`, or reflection padding is as large as the image.
pub fn conv2d(
    shape: &ConvShape,
    x: &[f32],
    weight: &[f32],
    bias: Option<&[f32]>,
    out: &mut [impl Slot],
) {
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
    let out = room(out);
    let sum = winograd_sum(shape, x, weight, bias);
    if shape.is_plain_3x3() && sum.is_faster() {
        return by_winograd(shape, &sum, out);
    }
    let out = SharedMut::new(out);
    let row_floats = shape.in_channels * shape.stride * (shape.in_width + 2 * shape.padding)
        + shape.out_channels * (shape.out_width() + 2);
    let tiles = tiles(shape.batch, 0, shape.out_height(), row_floats);
    let arithmetic = Arithmetic::of(shape);
    let run = |weight: &[f32]| {
        tasks(&tiles, shape.out_channels, arithmetic.rows())
            .into_par_iter()
            .for_each(|(tile, channels)| {
                forward_tile(shape, arithmetic, tile, channels, x, weight, bias, &out);
            });
    };
    if arithmetic == Arithmetic::Single {
        // They already have the right layout.
        return run(weight);
    }
    let taps: Vec<usize> = (0..shape.kernel_area()).collect();
    let weights = Weights {
        values: weight,
        strides: (shape.taps(), shape.kernel_area()),
        channels: shape.in_channels,
        taps: &taps,
    };
    let row = arithmetic.row_len(shape.in_channels, taps.len());
    with_scratch(shape.out_channels * row, |prepared| {
        arithmetic.prepare(weights, prepared);
        run(prepared);
    });
}

/// A 3×3 convolution with a margin of one pixel, in Winograd's form.
pub(super) fn winograd_sum<'a>(
    shape: &ConvShape,
    x: &'a [f32],
    weight: &'a [f32],
    bias: Option<&'a [f32]>,
) -> winograd::Sum<'a> {
    winograd::Sum {
        source: Image::of(shape, x),
        out: (shape.out_height(), shape.out_width()),
        rows: shape.out_channels,
        kernels: Kernels {
            values: weight,
            strides: (shape.taps(), shape.kernel_area()),
            turned: false,
        },
        bias,
    }
}

pub(super) fn by_winograd(
    shape: &ConvShape,
    sum: &winograd::Sum<'_>,
    out: &mut [MaybeUninit<f32>],
) {
    let (height, width) = sum.out;
    let out = SharedMut::new(out);
    sum.run(|image, channel, (y, x), values| {
        let at = ((image * shape.out_channels + channel) * height + y) * width + x;
        // SAFETY: `run` passes each line once, and no two overlap.
        let to = unsafe { out.slice(at, values.len()) };
        filled(to, values.iter().copied());
    });
}

fn forward_tile(
    shape: &ConvShape,
    arithmetic: Arithmetic,
    tile: Tile,
    channels: Range<usize>,
    x: &[f32],
    weight: &[f32],
    bias: Option<&[f32]>,
    out: &SharedMut<MaybeUninit<f32>>,
) {
    let lattice = Lattice::new(shape.window(), tile);
    let columns = arithmetic.columns(&lattice);
    let taps: Vec<usize> = shape.kernel_taps().map(|t| lattice.offset(t)).collect();
    let offsets = arithmetic.offsets(shape.in_channels, lattice.plane_len, &taps);
    let row = arithmetic.row_len(shape.in_channels, taps.len());
    let source_len = arithmetic.source_len(shape.in_channels, lattice.plane_len);
    with_scratch(source_len + channels.len() * columns, |buffer| {
        let (source, result) = buffer.split_at_mut(source_len);
        arithmetic.gather(&lattice, x, shape.in_channels, source);
        arithmetic.product(Product {
            weights: &weight[channels.start * row..channels.end * row],
            rows: channels.len(),
            channels: shape.in_channels,
            offsets: &offsets,
            plane_len: lattice.plane_len,
            source,
            columns,
            out: result,
        });
        let (area, width) = (shape.out_area(), shape.out_width());
        for (channel, result) in channels.clone().zip(result.chunks_exact(columns)) {
            let bias = bias.map_or(0.0, |b| b[channel]);
            for image in 0..tile.images {
                let plane = ((tile.first_image + image) * shape.out_channels + channel) * area;
                for row in 0..tile.rows {
                    // SAFETY: a row of this task's tile and channels.
                    let to = unsafe { out.slice(plane + (tile.first_row + row) * width, width) };
                    let from = &result[lattice.column(image, row)..][..width];
                    filled(to, from.iter().map(|from| from + bias));
                }
            }
        }
    });
}
