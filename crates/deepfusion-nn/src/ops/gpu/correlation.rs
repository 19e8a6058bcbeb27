//! Local correlation.

use super::grid::plane_of_group;
use super::{along_pixels, dims, input, output, room};
use burn_cubecl::cubecl;
use burn_cubecl::cubecl::prelude::*;
use burn_cubecl::tensor::CubeTensor;

/// A plane is a displacement of an image.
#[cube(launch)]
fn correlation(
    first: &[f32],
    second: &[f32],
    out: &mut [f32],
    channels: usize,
    height: usize,
    width: usize,
    #[comptime] radius: i32,
) {
    let area = height * width;
    let pixel = ABSOLUTE_POS_X as usize;
    if pixel >= area {
        terminate!();
    }
    let side = comptime!(2 * radius as usize + 1);
    let plane = plane_of_group();
    let n = plane / (side * side);
    let displacement = plane % (side * side);
    let y = (pixel / width) as i32 + (displacement / side) as i32 - radius;
    let x = (pixel % width) as i32 + (displacement % side) as i32 - radius;
    let mut sum = 0.0f32;
    if x >= 0 && x < width as i32 && y >= 0 && y < height as i32 {
        let there = y as usize * width + x as usize;
        for c in 0..channels {
            let at = (n * channels + c) * area;
            sum += first[at + pixel] * second[at + there];
        }
    }
    out[plane * area + pixel] = sum / (channels as f32);
}

/// The gradient of one image from the other: that of the first from the second at p + d, that of the second from the first at p − d. A
/// plane is a channel.
#[cube(launch)]
fn correlation_backward(
    other: &[f32],
    grad: &[f32],
    out: &mut [f32],
    channels: usize,
    height: usize,
    width: usize,
    #[comptime] radius: i32,
    #[comptime] of_first: bool,
) {
    let area = height * width;
    let pixel = ABSOLUTE_POS_X as usize;
    if pixel >= area {
        terminate!();
    }
    let side = comptime!(2 * radius + 1);
    let plane = plane_of_group();
    let n = plane / channels;
    let (at_y, at_x) = ((pixel / width) as i32, (pixel % width) as i32);
    let mut sum = 0.0f32;
    for row in 0..side {
        for column in 0..side {
            let mut y = at_y + row - radius;
            let mut x = at_x + column - radius;
            if comptime!(!of_first) {
                y = at_y - row + radius;
                x = at_x - column + radius;
            }
            if x >= 0 && x < width as i32 && y >= 0 && y < height as i32 {
                let there = y as usize * width + x as usize;
                let displacement = (row * side + column) as usize;
                let of = (n * comptime!((side * side) as usize) + displacement) * area;
                if comptime!(of_first) {
                    sum += grad[of + pixel] * other[plane * area + there];
                } else {
                    sum += grad[of + there] * other[plane * area + there];
                }
            }
        }
    }
    out[plane * area + pixel] = sum / (channels as f32);
}

pub(super) fn forward(first: CubeTensor, second: CubeTensor, radius: usize) -> CubeTensor {
    let [batch, channels, height, width] = dims(&first);
    let displacements = (2 * radius + 1) * (2 * radius + 1);
    let out = room(&first, [batch, displacements, height, width]);
    let (count, dim) = along_pixels(height * width, batch * displacements);
    correlation::launch(
        &out.client,
        count,
        dim,
        input(first),
        input(second),
        output(&out),
        channels,
        height,
        width,
        radius as i32,
    );
    out
}

/// The gradient of the first image from the second, or the other way round.
pub(super) fn backward(
    other: CubeTensor,
    grad: CubeTensor,
    radius: usize,
    of_first: bool,
) -> CubeTensor {
    let sizes @ [batch, channels, height, width] = dims::<4>(&other);
    let out = room(&other, sizes);
    let (count, dim) = along_pixels(height * width, batch * channels);
    correlation_backward::launch(
        &out.client,
        count,
        dim,
        input(other),
        input(grad),
        output(&out),
        channels,
        height,
        width,
        radius as i32,
        of_first,
    );
    out
}
