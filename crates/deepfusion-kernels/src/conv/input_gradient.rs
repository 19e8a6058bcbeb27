use super::{
    ConvShape,
    forward::{gather, tasks},
    lattice::{Lattice, Tile, Window, inside, tiles},
    product::{TapProduct, padded},
};
use crate::{
    scratch::with_scratch,
    send_ptr::SharedMut,
    slot::{Slot, room},
};
use rayon::prelude::*;
use std::mem::MaybeUninit;
use std::ops::Range;

/// The padded input rows and columns of one residue by the stride: a convolution of ∂Y at stride 1 with
/// those taps alone that reach them.
struct Phase<'a> {
    down: usize,
    right: usize,
    /// Taps (index in the kernel, distance from the first tap).
    taps: Vec<(usize, (usize, usize))>,
    /// Transposed weights, C × (O·taps).
    weights: &'a [f32],
}

/// ∂L/∂X: every input pixel gathers from the outputs it went into.
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
    grad_x: &mut [impl Slot],
) {
    let grad_x = room(grad_x);
    shape.check();
    assert_eq!(weight.len(), shape.weight_len(), "weight length");
    assert_eq!(grad_out.len(), shape.out_len(), "output gradient length");
    assert_eq!(grad_x.len(), shape.in_len(), "input gradient length");
    if grad_x.is_empty() {
        return;
    }
    // Elsewhere every value is written exactly once.
    if shape.stride > 1 || shape.reflect || grad_out.is_empty() {
        let zero = MaybeUninit::new(0.0);
        grad_x.par_chunks_mut(1 << 16).for_each(|c| c.fill(zero));
    }
    if grad_out.is_empty() {
        return;
    }
    // Each weight belongs to one phase.
    with_scratch(shape.weight_len(), |transposed| {
        let phases = phases(shape, weight, transposed);
        backward_input(shape, &phases, grad_out, grad_x);
    });
}

/// With reflection, what it adds to must have been cleared.
fn backward_input(
    shape: &ConvShape,
    phases: &[Phase],
    grad_out: &[f32],
    grad_x: &mut [MaybeUninit<f32>],
) {
    let (s, margin) = (shape.stride, margin(shape));
    let window = gradient_window(shape, margin);
    // Rows of a phase; without reflection those that lie wholly in the padding are left out.
    let all = shape.out_height() + shape.reach().0 / s;
    let rows = if shape.reflect {
        0..all
    } else {
        margin / s..(margin + shape.in_height).div_ceil(s).min(all)
    };
    let row_floats = shape.out_channels * (window.width + 2 * window.padding.1)
        + shape.in_channels * (window.out_width + 2);
    let tiles = tiles(shape.batch, rows.start, rows.len(), row_floats);
    let to = SharedMut::new(grad_x);
    if shape.reflect {
        // Mirrored rows may fall into the neighbouring tile: the tiles of an image take turns.
        tiles
            .chunk_by(|a, b| a.first_image == b.first_image)
            .collect::<Vec<_>>()
            .into_par_iter()
            .for_each(|of_image| {
                for tile in of_image {
                    let channels = 0..shape.in_channels;
                    gradient_tile(shape, window, *tile, channels, phases, grad_out, &to);
                }
            });
    } else {
        tasks(&tiles, shape.in_channels)
            .into_par_iter()
            .for_each(|(tile, channels)| {
                gradient_tile(shape, window, tile, channels, phases, grad_out, &to);
            });
    }
}

/// Rows and columns around the image whose gradient is worked out too.
///
/// What lands in a padding of zeros is needed by nobody: at stride 1 it is left out, which for 10×3 pixels is a
/// third of the work. Elsewhere it costs less than to tell it apart, or, mirrored, belongs to pixels of the image.
fn margin(shape: &ConvShape) -> usize {
    let (down, right) = shape.reach();
    let needless = shape.stride == 1 && !shape.reflect && shape.padding <= down.min(right);
    if needless { 0 } else { shape.padding }
}

/// How a phase of the input, with its margin, looks at ∂Y.
fn gradient_window(shape: &ConvShape, margin: usize) -> Window {
    let (down, right) = shape.reach();
    let reach = (down / shape.stride, right / shape.stride);
    let skipped = shape.padding - margin;
    Window {
        height: shape.out_height(),
        width: shape.out_width(),
        padding: (reach.0 - skipped, reach.1 - skipped),
        reflect: false,
        stride: 1,
        reach,
        out_width: shape.out_width() + reach.1 - 2 * skipped,
    }
}

/// All phases that have taps; their weights are written to `transposed`, one after the other.
fn phases<'a>(shape: &ConvShape, weight: &[f32], transposed: &'a mut [f32]) -> Vec<Phase<'a>> {
    let s = shape.stride;
    let mut rest = transposed;
    let mut phases = Vec::new();
    for (down, right) in (0..s * s).map(|i| (i / s, i % s)) {
        let taps: Vec<_> = shape
            .kernel_taps()
            .enumerate()
            .filter(|(_, (y, x))| y % s == down && x % s == right)
            .collect();
        if taps.is_empty() {
            continue;
        }
        let len = shape.in_channels * shape.out_channels * taps.len();
        let (weights, after) = rest.split_at_mut(len);
        rest = after;
        transpose_weights(shape, weight, &taps, weights);
        phases.push(Phase {
            down,
            right,
            taps,
            weights,
        });
    }
    phases
}

/// From O × (C·kernel) to C × (O·taps).
fn transpose_weights(
    shape: &ConvShape,
    weight: &[f32],
    taps: &[(usize, (usize, usize))],
    to: &mut [f32],
) {
    /// Channels of a task: their taps lie side by side.
    const GROUP: usize = 8;
    let (area, channels, count) = (shape.kernel_area(), shape.in_channels, taps.len());
    let row = shape.out_channels * count;
    to.par_chunks_mut(GROUP * row)
        .enumerate()
        .for_each(|(group, to)| {
            for output in 0..shape.out_channels {
                let from = &weight[(output * channels + group * GROUP) * area..];
                for (to, from) in to.chunks_exact_mut(row).zip(from.chunks_exact(area)) {
                    let to = &mut to[output * count..][..count];
                    if let (Some(to), Some(from)) = (to.as_mut_array::<9>(), from.as_array::<9>()) {
                        // The usual 3×3: a copy of known length needs no call.
                        *to = *from;
                    } else {
                        for (to, (tap, _)) in to.iter_mut().zip(taps) {
                            *to = from[*tap];
                        }
                    }
                }
            }
        });
}

fn gradient_tile(
    shape: &ConvShape,
    window: Window,
    tile: Tile,
    channels: Range<usize>,
    phases: &[Phase],
    grad_out: &[f32],
    to: &SharedMut<MaybeUninit<f32>>,
) {
    let lattice = Lattice::new(window, tile);
    let columns = padded(lattice.columns());
    let source_len = shape.out_channels * lattice.plane_len;
    with_scratch(source_len + channels.len() * columns, |buffer| {
        let (source, result) = buffer.split_at_mut(source_len);
        let outputs = 0..shape.out_channels;
        gather(&lattice, grad_out, shape.out_channels, outputs, source);
        for phase in phases {
            let offsets: Vec<usize> = (0..shape.out_channels)
                .flat_map(|o| {
                    phase.taps.iter().map(move |(_, (y, x))| {
                        let (y, x) = (y / shape.stride, x / shape.stride);
                        let shift = (window.reach.0 - y, window.reach.1 - x);
                        o * lattice.plane_len + lattice.offset(shift)
                    })
                })
                .collect();
            let row = offsets.len();
            TapProduct {
                weights: &phase.weights[channels.start * row..channels.end * row],
                weight_stride: row,
                offsets: &offsets,
                source,
                columns,
                out: &mut *result,
                rows: channels.len(),
            }
            .run();
            for (channel, result) in channels.clone().zip(result.chunks_exact(columns)) {
                scatter(shape, &lattice, tile, phase, channel, result, to);
            }
        }
    });
}

/// Writes one channel of a phase to the pixels it belongs to; mirrored margins are added to theirs.
fn scatter(
    shape: &ConvShape,
    lattice: &Lattice,
    tile: Tile,
    phase: &Phase,
    channel: usize,
    result: &[f32],
    to: &SharedMut<MaybeUninit<f32>>,
) {
    let (s, p) = (shape.stride, margin(shape));
    let (height, width) = (shape.in_height, shape.in_width);
    let count = gradient_window(shape, p).out_width;
    // Columns whose pixel lies inside: 0 <= s·x + right − p < width.
    let first = p.saturating_sub(phase.right).div_ceil(s).min(count);
    let last = (width + p)
        .saturating_sub(phase.right)
        .div_ceil(s)
        .clamp(first, count);
    for image in 0..tile.images {
        let plane = ((tile.first_image + image) * shape.in_channels + channel) * height * width;
        for row in 0..tile.rows {
            let y = (tile.first_row + row) * s + phase.down;
            let Some(y) = inside(y, p, height, shape.reflect) else {
                continue;
            };
            // SAFETY: rows of this task's images and channels; tasks with the same image have other rows,
            // or, with reflection, run one after the other.
            let to = unsafe { to.slice(plane + y * width, width) };
            let from = &result[lattice.column(image, row)..][..count];
            let start = first * s + phase.right;
            let body = &from[first..last];
            if shape.reflect {
                // SAFETY: with reflection everything was cleared at first.
                let to = unsafe { to.assume_init_mut() };
                for x in (0..first).chain(last..count) {
                    if let Some(at) = inside(x * s + phase.right, p, width, true) {
                        to[at] += from[x];
                    }
                }
                if !body.is_empty() {
                    let to = to[start - p..].iter_mut().step_by(s);
                    to.zip(body).for_each(|(to, from)| *to += *from);
                }
            } else if !body.is_empty() {
                let to = to[start - p..].iter_mut().step_by(s);
                to.zip(body).for_each(|(to, from)| {
                    to.write(*from);
                });
            }
        }
    }
}
