//! Depthwise convolution at stride 1 that keeps the size, with a border of zeros.

use super::grid::{over_group, plane_of_group};
use super::{SUM_THREADS, along_pixels, dims, input, output, room, summing};
use burn_cubecl::cubecl;
use burn_cubecl::cubecl::prelude::*;
use burn_cubecl::kernel::into_contiguous;
use burn_cubecl::tensor::CubeTensor;

/// A plane is an image's channel. `is_backward`: the gradient of the input from that of the output, with the taps in the opposite order.
#[cube(launch)]
fn depthwise(
    x: &[f32],
    weight: &[f32],
    out: &mut [f32],
    channels: usize,
    height: usize,
    width: usize,
    #[comptime] kernel: usize,
    #[comptime] dilation: usize,
    #[comptime] is_backward: bool,
) {
    let area = height * width;
    let pixel = ABSOLUTE_POS_X as usize;
    if pixel >= area {
        terminate!();
    }
    let plane = plane_of_group();
    let taps = plane % channels * comptime!(kernel * kernel);
    let (at_y, at_x) = ((pixel / width) as i32, (pixel % width) as i32);
    let mut sum = 0.0f32;
    #[unroll]
    for row in 0..kernel {
        #[unroll]
        for column in 0..kernel {
            let (down, across) = comptime! {
                let middle = (kernel / 2) as i32;
                let away = |tap: usize| (tap as i32 - middle) * dilation as i32;
                let sign = if is_backward { -1 } else { 1 };
                (sign * away(row), sign * away(column))
            };
            let (y, u) = (at_y + down, at_x + across);
            if y >= 0 && y < height as i32 && u >= 0 && u < width as i32 {
                let tap = taps + comptime!(row * kernel + column);
                sum += weight[tap] * x[plane * area + y as usize * width + u as usize];
            }
        }
    }
    out[plane * area + pixel] = sum;
}

/// Each group of threads sums one tap of a channel's kernel over all images.
#[cube(launch)]
fn weight_gradient(
    x: &[f32],
    grad: &[f32],
    out: &mut [f32],
    batch: usize,
    channels: usize,
    height: usize,
    width: usize,
    #[comptime] kernel: usize,
    #[comptime] dilation: usize,
    #[comptime] threads: u32,
) {
    let tap = CUBE_POS_Y as usize;
    let channel = tap / comptime!(kernel * kernel);
    let own = tap % comptime!(kernel * kernel);
    let middle = comptime!((kernel / 2 * dilation) as i32);
    let down = (own / kernel * dilation) as i32 - middle;
    let across = (own % kernel * dilation) as i32 - middle;
    let area = height * width;
    let mut sum = 0.0f32;
    for image in 0..batch {
        let plane = (image * channels + channel) * area;
        let mut at = UNIT_POS as usize;
        while at < area {
            let y = (at / width) as i32 + down;
            let u = (at % width) as i32 + across;
            if y >= 0 && y < height as i32 && u >= 0 && u < width as i32 {
                sum += grad[plane + at] * x[plane + y as usize * width + u as usize];
            }
            at += threads as usize;
        }
    }
    let total = over_group(sum, threads);
    if UNIT_POS == 0 {
        out[tap] = total;
    }
}

fn run(x: CubeTensor, weight: CubeTensor, dilation: usize, is_backward: bool) -> CubeTensor {
    let sizes @ [batch, channels, height, width] = dims::<4>(&x);
    let [_, _, kernel, _] = dims(&weight);
    let out = room(&x, sizes);
    let (count, dim) = along_pixels(height * width, batch * channels);
    depthwise::launch(
        &out.client,
        count,
        dim,
        input(x),
        input(weight),
        output(&out),
        channels,
        height,
        width,
        kernel,
        dilation,
        is_backward,
    );
    out
}

pub(super) fn forward(x: CubeTensor, weight: CubeTensor, dilation: usize) -> CubeTensor {
    run(x, weight, dilation, false)
}

pub(super) fn grad_input(weight: CubeTensor, grad: CubeTensor, dilation: usize) -> CubeTensor {
    run(grad, weight, dilation, true)
}

/// The gradient of weights of this shape.
pub(super) fn grad_weight(
    x: CubeTensor,
    grad: CubeTensor,
    shape @ [_, _, kernel, _]: [usize; 4],
    dilation: usize,
) -> CubeTensor {
    let [batch, channels, height, width] = dims(&x);
    let out = room(&x, shape);
    let client = out.client.clone();
    let [x, grad] = [x, grad].map(into_contiguous);
    let (count, dim) = summing(1, channels * kernel * kernel);
    weight_gradient::launch(
        &client,
        count,
        dim,
        input(x),
        input(grad),
        output(&out),
        batch,
        channels,
        height,
        width,
        kernel,
        dilation,
        SUM_THREADS,
    );
    out
}
