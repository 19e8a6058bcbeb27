use super::{
    ConvShape,
    arithmetic::{Arithmetic, Product, Weights},
    forward::tasks,
    lattice::{Lattice, Tile, Window, inside, tiles},
    winograd::{self, Image, Kernels, Margins},
};
use crate::{
    scratch::with_scratch,
    send_ptr::SharedMut,
    slot::{Slot, filled, room},
};
use rayon::prelude::*;
use std::mem::MaybeUninit;
use std::ops::Range;

/// Padded input rows and columns with the same remainder modulo the stride. Their gradient is a convolution of ∂Y at stride 1 with the taps
/// that reach them.
struct Phase<'a> {
    down: usize,
    right: usize,
    /// Taps: index in the kernel, and distance from the first tap.
    taps: Vec<(usize, (usize, usize))>,
    /// Transposed weights: C rows of O·taps in the arithmetic's layout.
    weights: &'a [f32],
}

/// ∂L/∂X: every input pixel sums the gradients of the outputs that it contributed to.
///
/// # Shapes
/// `weight` O×C×kh×kw, `grad_out` N×O×H_out×W_out, `grad_x` N×C×H×W, overwritten.
///
/// # Panics
/// If a length does not match `shape`.
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
    let sum = winograd_sum(shape, weight, grad_out);
    if shape.is_plain_3x3() && sum.is_faster() {
        return by_winograd(shape, &sum, grad_x);
    }
    // Without reflection, every value is written exactly once.
    if shape.stride > 1 || shape.reflect || grad_out.is_empty() {
        let zero = MaybeUninit::new(0.0);
        grad_x.par_chunks_mut(1 << 16).for_each(|c| c.fill(zero));
    }
    if grad_out.is_empty() {
        return;
    }
    let arithmetic = Arithmetic::of(shape);
    // Each weight belongs to one phase.
    let words = shape.in_channels * arithmetic.row_len(shape.out_channels, shape.kernel_area());
    with_scratch(words, |transposed| {
        let phases = phases(shape, arithmetic, weight, transposed);
        backward_input(shape, arithmetic, &phases, grad_out, grad_x);
    });
}

/// The gradient of a 3×3 convolution with a margin of one pixel, in Winograd's form: every pixel sums the gradients of the outputs that it
/// contributed to.
pub(super) fn winograd_sum<'a>(
    shape: &ConvShape,
    weight: &'a [f32],
    grad_out: &'a [f32],
) -> winograd::Sum<'a> {
    // If mirrored, the margin's gradient belongs to pixels of the image; in a padding of zeros it is not needed.
    let margin = if shape.reflect { shape.padding } else { 0 };
    winograd::Sum {
        source: Image {
            values: grad_out,
            images: shape.batch,
            channels: shape.out_channels,
            size: (shape.out_height(), shape.out_width()),
            padding: shape.padding + margin,
            reflect: false,
        },
        out: (shape.in_height + 2 * margin, shape.in_width + 2 * margin),
        rows: shape.in_channels,
        kernels: Kernels {
            values: weight,
            strides: (shape.kernel_area(), shape.taps()),
            turned: true,
        },
        bias: None,
    }
}

pub(super) fn by_winograd(
    shape: &ConvShape,
    sum: &winograd::Sum<'_>,
    grad_x: &mut [MaybeUninit<f32>],
) {
    let (height, width) = (shape.in_height, shape.in_width);
    let plane = |image: usize, channel: usize| image * shape.in_channels + channel;
    let to = SharedMut::new(grad_x);
    let write = |plane: usize, (y, x): (usize, usize), values: &[f32]| {
        // SAFETY: `run` passes each line once, and no two overlap.
        let to = unsafe { to.slice((plane * height + y) * width + x, values.len()) };
        filled(to, values.iter().copied());
    };
    if !shape.reflect {
        return sum.run(|image, channel, at, values| write(plane(image, channel), at, values));
    }
    let margins = Margins::new((height, width));
    with_scratch(shape.batch * shape.in_channels * margins.len(), |kept| {
        let kept = SharedMut::new(kept);
        sum.run(|image, channel, at, values| {
            let plane = plane(image, channel);
            margins.split(
                at,
                values,
                |y, x, values| write(plane, (y, x), values),
                |at, values| {
                    // SAFETY: as above; the pieces of a line have separate places.
                    let to = unsafe { kept.slice(plane * margins.len() + at, values.len()) };
                    to.copy_from_slice(values);
                },
            );
        });
        (0..shape.batch * shape.in_channels)
            .into_par_iter()
            .for_each(|plane| {
                // SAFETY: one plane each, all of which were written.
                let (kept, to) = unsafe {
                    (
                        kept.slice(plane * margins.len(), margins.len()),
                        to.slice(plane * height * width, height * width)
                            .assume_init_mut(),
                    )
                };
                margins.fold(kept, to);
            });
    });
}

/// With reflection, `grad_x` must have been cleared, as gradients are added to it.
fn backward_input(
    shape: &ConvShape,
    arithmetic: Arithmetic,
    phases: &[Phase],
    grad_out: &[f32],
    grad_x: &mut [MaybeUninit<f32>],
) {
    let (s, margin) = (shape.stride, margin(shape));
    let window = gradient_window(shape, margin);
    // Rows of a phase; without reflection, those that are completely in the padding are left out.
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
        // Mirrored rows may be in the neighbouring tile, so the tiles of an image are processed one after the other.
        tiles
            .chunk_by(|a, b| a.first_image == b.first_image)
            .collect::<Vec<_>>()
            .into_par_iter()
            .for_each(|of_image| {
                for tile in of_image {
                    let channels = 0..shape.in_channels;
                    let tile = (window, *tile);
                    gradient_tile(shape, arithmetic, tile, channels, phases, grad_out, &to);
                }
            });
    } else {
        tasks(&tiles, shape.in_channels, arithmetic.rows())
            .into_par_iter()
            .for_each(|(tile, channels)| {
                let tile = (window, tile);
                gradient_tile(shape, arithmetic, tile, channels, phases, grad_out, &to);
            });
    }
}

/// Width of the margin around the image whose gradient is also computed.
///
/// The gradient of a padding of zeros is not needed. At stride 1 it is left out, which for 10×3 pixels is a third of the work. At other
/// strides, computing it costs less than leaving it out. If mirrored, it belongs to pixels of the image.
fn margin(shape: &ConvShape) -> usize {
    let (down, right) = shape.reach();
    let needless = shape.stride == 1 && !shape.reflect && shape.padding <= down.min(right);
    if needless { 0 } else { shape.padding }
}

/// How a phase of the input, with its margin, reads ∂Y.
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

/// All phases that have taps; their weights are written to `transposed` one after the other.
fn phases<'a>(
    shape: &ConvShape,
    arithmetic: Arithmetic,
    weight: &[f32],
    transposed: &'a mut [f32],
) -> Vec<Phase<'a>> {
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
        let row = arithmetic.row_len(shape.out_channels, taps.len());
        let (weights, after) = rest.split_at_mut(shape.in_channels * row);
        rest = after;
        let in_kernel: Vec<usize> = taps.iter().map(|(tap, _)| *tap).collect();
        let transposed = Weights {
            values: weight,
            strides: (shape.kernel_area(), shape.taps()),
            channels: shape.out_channels,
            taps: &in_kernel,
        };
        arithmetic.prepare(transposed, weights);
        phases.push(Phase {
            down,
            right,
            taps,
            weights,
        });
    }
    phases
}

fn gradient_tile(
    shape: &ConvShape,
    arithmetic: Arithmetic,
    (window, tile): (Window, Tile),
    channels: Range<usize>,
    phases: &[Phase],
    grad_out: &[f32],
    to: &SharedMut<MaybeUninit<f32>>,
) {
    let lattice = Lattice::new(window, tile);
    let (columns, outputs) = (arithmetic.columns(&lattice), shape.out_channels);
    let source_len = arithmetic.source_len(outputs, lattice.plane_len);
    with_scratch(source_len + channels.len() * columns, |buffer| {
        let (source, result) = buffer.split_at_mut(source_len);
        arithmetic.gather(&lattice, grad_out, outputs, source);
        for phase in phases {
            let of_tap = |(_, (y, x)): &(usize, (usize, usize))| {
                let (y, x) = (y / shape.stride, x / shape.stride);
                lattice.offset((window.reach.0 - y, window.reach.1 - x))
            };
            let taps: Vec<usize> = phase.taps.iter().map(of_tap).collect();
            let row = arithmetic.row_len(outputs, taps.len());
            arithmetic.product(Product {
                weights: &phase.weights[channels.start * row..channels.end * row],
                rows: channels.len(),
                channels: outputs,
                offsets: &arithmetic.offsets(outputs, lattice.plane_len, &taps),
                plane_len: lattice.plane_len,
                source,
                columns,
                out: &mut *result,
            });
            for (channel, result) in channels.clone().zip(result.chunks_exact(columns)) {
                scatter(shape, &lattice, tile, phase, channel, result, to);
            }
        }
    });
}

/// Writes one channel of a phase to its pixels; mirrored margins are added to theirs.
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
    // Columns whose pixel is in the image: 0 <= s·x + right − p < width.
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
            // SAFETY: rows of this task's images and channels. Tasks with the same image have other rows or, with reflection, run one after
            // the other.
            let to = unsafe { to.slice(plane + y * width, width) };
            let from = &result[lattice.column(image, row)..][..count];
            let start = first * s + phase.right;
            let body = &from[first..last];
            if shape.reflect {
                // SAFETY: with reflection, everything was cleared before.
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
