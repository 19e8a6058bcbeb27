//! Padding that mirrors an image without repeating its edge.

use super::super::kernel::ConvOptions;
use super::grid::plane_of_group;
use super::{along_pixels, dims, input, output, room};
use burn_cubecl::cubecl;
use burn_cubecl::cubecl::prelude::*;
use burn_cubecl::tensor::CubeTensor;

/// The pixel along an axis of `size` that a pixel outside mirrors; a pixel inside is itself.
#[cube]
pub(super) fn source(at: i32, size: i32) -> i32 {
    let last = size - 1;
    let ahead = select(at < 0, 0 - at, at);
    select(ahead > last, 2 * last - ahead, ahead)
}

#[cube(launch)]
fn mirror(x: &[f32], out: &mut [f32], height: i32, width: i32, margin: i32) {
    let (out_height, out_width) = (height + 2 * margin, width + 2 * margin);
    let pixel = ABSOLUTE_POS_X as i32;
    if pixel >= out_height * out_width {
        terminate!();
    }
    let plane = plane_of_group();
    let y = source(pixel / out_width - margin, height);
    let v = source(pixel % out_width - margin, width);
    let from = plane * (height * width) as usize + (y * width + v) as usize;
    out[plane * (out_height * out_width) as usize + pixel as usize] = x[from];
}

/// The first, second and third place along an axis of the padded image that reads a pixel; −1 for none.
#[cube]
fn reader(at: i32, size: i32, margin: i32, #[comptime] which: u32) -> i32 {
    let last = size - 1;
    if comptime!(which == 0) {
        at + margin
    } else if comptime!(which == 1) {
        select(at >= 1 && at <= margin, margin - at, -1)
    } else {
        let is_read = at < last && at >= last - margin;
        select(is_read, margin + 2 * last - at, -1)
    }
}

#[cube(launch)]
fn mirror_backward(grad: &[f32], out: &mut [f32], height: i32, width: i32, margin: i32) {
    let pixel = ABSOLUTE_POS_X as i32;
    if pixel >= height * width {
        terminate!();
    }
    let plane = plane_of_group();
    let (grad_height, grad_width) = (height + 2 * margin, width + 2 * margin);
    let mut sum = 0.0f32;
    #[unroll]
    for i in 0..3u32 {
        let y = reader(pixel / width, height, margin, i);
        #[unroll]
        for j in 0..3u32 {
            let x = reader(pixel % width, width, margin, j);
            if y >= 0 && x >= 0 {
                let at = plane * (grad_height * grad_width) as usize;
                sum += grad[at + (y * grad_width + x) as usize];
            }
        }
    }
    out[plane * (height * width) as usize + pixel as usize] = sum;
}

/// Whether a convolution's padding mirrors.
fn is_needed(options: ConvOptions) -> bool {
    options.reflect && options.padding > 0
}

/// The same convolution for an image that is already padded.
fn without(options: ConvOptions) -> ConvOptions {
    ConvOptions {
        padding: 0,
        reflect: false,
        ..options
    }
}

/// The width of the mirrored margin, and the same convolution for an image with that margin.
pub(super) fn margin(options: ConvOptions) -> (usize, ConvOptions) {
    if is_needed(options) {
        (options.padding, without(options))
    } else {
        (0, options)
    }
}

/// An image with a mirrored margin; unchanged if the margin is 0.
pub(super) fn padded(x: CubeTensor, margin: usize) -> CubeTensor {
    match margin {
        0 => x,
        _ => forward(x, margin),
    }
}

/// `[N, C, H, W]` to `[N, C, H + 2·margin, W + 2·margin]`; the margin is below both sides.
fn forward(x: CubeTensor, margin: usize) -> CubeTensor {
    let [batch, channels, height, width] = dims(&x);
    let (out_height, out_width) = (height + 2 * margin, width + 2 * margin);
    let out = room(&x, [batch, channels, out_height, out_width]);
    let (count, dim) = along_pixels(out_height * out_width, batch * channels);
    let [height, width, margin] = [height, width, margin].map(|size| size as i32);
    let client = out.client.clone();
    mirror::launch(
        &client,
        count,
        dim,
        input(x),
        output(&out),
        height,
        width,
        margin,
    );
    out
}

/// The gradient of the image without padding.
pub(super) fn backward(grad: CubeTensor, margin: usize) -> CubeTensor {
    let [batch, channels, height, width] = dims(&grad);
    let (height, width) = (height - 2 * margin, width - 2 * margin);
    let out = room(&grad, [batch, channels, height, width]);
    let (count, dim) = along_pixels(height * width, batch * channels);
    let [height, width, margin] = [height, width, margin].map(|size| size as i32);
    let client = out.client.clone();
    mirror_backward::launch(
        &client,
        count,
        dim,
        input(grad),
        output(&out),
        height,
        width,
        margin,
    );
    out
}
