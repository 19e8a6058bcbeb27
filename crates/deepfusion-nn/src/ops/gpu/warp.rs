//! The bilinear warp.

use super::grid::plane_of_group;
use super::{along_pixels, dims, input, output, room};
use burn::backend::ops::{FloatTensorOps, IntTensorOps};
use burn::tensor::{DType, IndexingUpdateOp, IntDType};
use burn_cubecl::CubeBackend;
use burn_cubecl::cubecl;
use burn_cubecl::cubecl::prelude::*;
use burn_cubecl::kernel::into_contiguous;
use burn_cubecl::tensor::CubeTensor;

/// The lower neighbour of a coordinate along an axis. At the end it is the last but one, so that there is a higher one.
#[cube]
fn lower(p: f32, size: usize) -> f32 {
    let last = (size as f32) - 1.0f32;
    p.max(0.0f32)
        .min(last)
        .floor()
        .min((last - 1.0f32).max(0.0f32))
}

/// The distance of a coordinate from its lower neighbour; outside the image, that of the border.
#[cube]
fn beyond(p: f32, low: f32, size: usize) -> f32 {
    p.max(0.0f32).min((size as f32) - 1.0f32) - low
}

/// What a pixel reads: its coordinates, the index of the lower corner in a plane, the steps to the other corners, and the coordinates'
/// distances from the lower corner.
#[derive(CubeType)]
struct Reading {
    u: f32,
    v: f32,
    corner: usize,
    right: usize,
    down: usize,
    fx: f32,
    fy: f32,
}

#[cube]
fn reading(
    coords: &[f32],
    n: usize,
    pixel: usize,
    area: usize,
    height: usize,
    width: usize,
) -> Reading {
    let u = coords[2 * n * area + pixel];
    let v = coords[(2 * n + 1) * area + pixel];
    let (low_x, low_y) = (lower(u, width), lower(v, height));
    Reading {
        u,
        v,
        corner: low_y as usize * width + low_x as usize,
        right: select(width > 1, 1usize, 0usize),
        down: select(height > 1, width, 0usize),
        fx: beyond(u, low_x, width),
        fy: beyond(v, low_y, height),
    }
}

#[cube(launch)]
fn warp(
    image: &[f32],
    coords: &[f32],
    out: &mut [f32],
    channels: usize,
    height: usize,
    width: usize,
    area: usize,
) {
    let pixel = ABSOLUTE_POS_X as usize;
    if pixel >= area {
        terminate!();
    }
    let n = plane_of_group();
    let read = reading(coords, n, pixel, area, height, width);
    let (corner, right, down) = (read.corner, read.right, read.down);
    let (fx, fy) = (read.fx, read.fy);
    for c in 0..channels {
        let at = (n * channels + c) * height * width + corner;
        let (a, b) = (image[at], image[at + right]);
        let (d, e) = (image[at + down], image[at + down + right]);
        let top = a + (b - a) * fx;
        let bottom = d + (e - d) * fx;
        out[(n * channels + c) * area + pixel] = top + (bottom - top) * fy;
    }
}

/// The gradient of the coordinates: zero outside the image, where the border is read.
#[cube(launch)]
fn grad_of_coords(
    image: &[f32],
    coords: &[f32],
    grad: &[f32],
    out: &mut [f32],
    channels: usize,
    height: usize,
    width: usize,
    area: usize,
) {
    let pixel = ABSOLUTE_POS_X as usize;
    if pixel >= area {
        terminate!();
    }
    let n = plane_of_group();
    let read = reading(coords, n, pixel, area, height, width);
    let (corner, right, down) = (read.corner, read.right, read.down);
    let (fx, fy) = (read.fx, read.fy);
    let mut along_x = 0.0f32;
    let mut along_y = 0.0f32;
    for c in 0..channels {
        let at = (n * channels + c) * height * width + corner;
        let (a, b) = (image[at], image[at + right]);
        let (d, e) = (image[at + down], image[at + down + right]);
        let g = grad[(n * channels + c) * area + pixel];
        along_x += g * ((b - a) * (1.0f32 - fy) + (e - d) * fy);
        along_y += g * ((d - a) * (1.0f32 - fx) + (e - b) * fx);
    }
    let (u, v) = (read.u, read.v);
    let moves_x = u >= 0.0f32 && u <= (width as f32) - 1.0f32;
    let moves_y = v >= 0.0f32 && v <= (height as f32) - 1.0f32;
    out[2 * n * area + pixel] = select(moves_x, along_x, 0.0f32);
    out[(2 * n + 1) * area + pixel] = select(moves_y, along_y, 0.0f32);
}

/// The gradient that each output pixel adds to one of the four pixels it reads, and the index of that pixel in its plane.
#[cube(launch)]
fn grad_of_corner(
    coords: &[f32],
    grad: &[f32],
    values: &mut [f32],
    places: &mut [i32],
    channels: usize,
    height: usize,
    width: usize,
    area: usize,
    #[comptime] is_right: bool,
    #[comptime] is_down: bool,
) {
    let pixel = ABSOLUTE_POS_X as usize;
    if pixel >= area {
        terminate!();
    }
    let n = plane_of_group();
    let read = reading(coords, n, pixel, area, height, width);
    let (mut place, mut x_share, mut y_share) = (read.corner, read.fx, read.fy);
    if comptime!(is_right) {
        place += read.right;
    } else {
        x_share = 1.0f32 - x_share;
    }
    if comptime!(is_down) {
        place += read.down;
    } else {
        y_share = 1.0f32 - y_share;
    }
    for c in 0..channels {
        let at = (n * channels + c) * area + pixel;
        values[at] = grad[at] * x_share * y_share;
        places[at] = place as i32;
    }
}

pub(super) fn forward(image: CubeTensor, coords: CubeTensor) -> CubeTensor {
    let [batch, channels, height, width] = dims(&image);
    let [_, _, out_height, out_width] = dims(&coords);
    let area = out_height * out_width;
    let out = room(&image, [batch, channels, out_height, out_width]);
    let (count, dim) = along_pixels(area, batch);
    warp::launch(
        &out.client,
        count,
        dim,
        input(image),
        input(coords),
        output(&out),
        channels,
        height,
        width,
        area,
    );
    out
}

pub(super) fn grad_coords(image: CubeTensor, coords: CubeTensor, grad: CubeTensor) -> CubeTensor {
    let [batch, channels, height, width] = dims(&image);
    let sizes @ [_, _, out_height, out_width] = dims::<4>(&coords);
    let area = out_height * out_width;
    let out = room(&image, sizes);
    let (count, dim) = along_pixels(area, batch);
    grad_of_coords::launch(
        &out.client,
        count,
        dim,
        input(image),
        input(coords),
        input(grad),
        output(&out),
        channels,
        height,
        width,
        area,
    );
    out
}

/// The gradient of the image, corner by corner. Several pixels may read the same one; Burn's scatter adds their gradients.
pub(super) fn grad_image(image: CubeTensor, coords: CubeTensor, grad: CubeTensor) -> CubeTensor {
    let sizes @ [batch, channels, height, width] = dims::<4>(&image);
    let [_, _, out_height, out_width] = dims(&coords);
    let (planes, area) = (height * width, out_height * out_width);
    let device = image.device.clone();
    let [coords, grad] = [coords, grad].map(into_contiguous);
    let flat = [batch, channels, planes].into();
    let mut sum = CubeBackend::float_zeros(flat, &device, DType::F32.into());
    for (is_right, is_down) in [(false, false), (true, false), (false, true), (true, true)] {
        let values = room(&image, [batch, channels, area]);
        let shape = [batch, channels, area].into();
        let places = CubeBackend::int_empty(shape, &device, IntDType::I32);
        let (count, dim) = along_pixels(area, batch);
        grad_of_corner::launch(
            &image.client,
            count,
            dim,
            input(coords.clone()),
            input(grad.clone()),
            output(&values),
            output(&places),
            channels,
            height,
            width,
            area,
            is_right,
            is_down,
        );
        sum = CubeBackend::float_scatter(2, sum, places, values, IndexingUpdateOp::Add);
    }
    CubeBackend::float_reshape(sum, sizes.into())
}
