//! Every pixel is repeated twice in both directions, and a skip feature appended.

use super::grid::plane_of_group;
use super::{along_pixels, dims, input, output, room};
use burn_cubecl::cubecl;
use burn_cubecl::cubecl::prelude::*;
use burn_cubecl::kernel::into_contiguous;
use burn_cubecl::tensor::CubeTensor;

/// A plane is an image's channel of the output, of `height` times `width` pixels.
#[cube(launch)]
fn upsample(
    x: &[f32],
    skip: &[f32],
    out: &mut [f32],
    channels: usize,
    skips: usize,
    height: usize,
    width: usize,
) {
    let area = height * width;
    let pixel = ABSOLUTE_POS_X as usize;
    if pixel >= area {
        terminate!();
    }
    let plane = plane_of_group();
    let (image, channel) = (plane / (channels + skips), plane % (channels + skips));
    if channel < channels {
        let (y, u) = (pixel / width / 2, pixel % width / 2);
        let from = (image * channels + channel) * (area / 4);
        out[plane * area + pixel] = x[from + y * (width / 2) + u];
    } else {
        let from = (image * skips + channel - channels) * area;
        out[plane * area + pixel] = skip[from + pixel];
    }
}

/// A plane is an image's channel of x, of `height` times `width` pixels: the sum over the four repetitions of each pixel.
#[cube(launch)]
fn sum_of_four(
    grad: &[f32],
    out: &mut [f32],
    channels: usize,
    all: usize,
    height: usize,
    width: usize,
) {
    let area = height * width;
    let pixel = ABSOLUTE_POS_X as usize;
    if pixel >= area {
        terminate!();
    }
    let plane = plane_of_group();
    let of_grad = plane / channels * all + plane % channels;
    let (y, x) = (2 * (pixel / width), 2 * (pixel % width));
    let first = (of_grad * 2 * height + y) * 2 * width + x;
    let second = first + 2 * width;
    out[plane * area + pixel] = grad[first] + grad[first + 1] + grad[second] + grad[second + 1];
}

/// A plane is an image's channel of the skip feature.
#[cube(launch)]
fn of_skip(grad: &[f32], out: &mut [f32], channels: usize, skips: usize, area: usize) {
    let pixel = ABSOLUTE_POS_X as usize;
    if pixel >= area {
        terminate!();
    }
    let plane = plane_of_group();
    let of_grad = plane / skips * (channels + skips) + channels + plane % skips;
    out[plane * area + pixel] = grad[of_grad * area + pixel];
}

pub(super) fn forward(x: CubeTensor, skip: CubeTensor) -> CubeTensor {
    let [batch, channels, height, width] = dims(&x);
    let [_, skips, _, _] = dims(&skip);
    let (height, width) = (2 * height, 2 * width);
    let out = room(&x, [batch, channels + skips, height, width]);
    let (count, dim) = along_pixels(height * width, batch * (channels + skips));
    let client = out.client.clone();
    // An empty buffer cannot be bound. Without a skip feature this one is not read.
    let skip = if skips == 0 { x.clone() } else { skip };
    upsample::launch(
        &client,
        count,
        dim,
        input(x),
        input(skip),
        output(&out),
        channels,
        skips,
        height,
        width,
    );
    out
}

/// The gradients of x, which has `channels` channels, and of the skip feature.
pub(super) fn backward(grad: CubeTensor, channels: usize) -> [CubeTensor; 2] {
    let [batch, all, height, width] = dims(&grad);
    let skips = all - channels;
    let grad = into_contiguous(grad);
    let of_x = room(&grad, [batch, channels, height / 2, width / 2]);
    let client = of_x.client.clone();
    let (count, dim) = along_pixels(height / 2 * (width / 2), batch * channels);
    sum_of_four::launch(
        &client,
        count,
        dim,
        input(grad.clone()),
        output(&of_x),
        channels,
        all,
        height / 2,
        width / 2,
    );
    let skip = room(&grad, [batch, skips, height, width]);
    if skips > 0 {
        let (count, dim) = along_pixels(height * width, batch * skips);
        of_skip::launch(
            &client,
            count,
            dim,
            input(grad),
            output(&skip),
            channels,
            skips,
            height * width,
        );
    }
    [of_x, skip]
}
