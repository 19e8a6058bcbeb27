//! Edge-aware smoothness (the paper's Eq. 8).

use super::grid::{over_group, plane_of_group};
use super::{SUM_GROUPS, SUM_THREADS, along_pixels, dims, input, output, room, summing};
use burn::backend::ops::FloatTensorOps;
use burn_cubecl::CubeBackend;
use burn_cubecl::cubecl;
use burn_cubecl::cubecl::prelude::*;
use burn_cubecl::kernel::into_contiguous;
use burn_cubecl::tensor::CubeTensor;

/// Keeps the division finite where a disparity is zero everywhere.
const EPSILON: f32 = 1e-7;

/// e^(−|∂I|) between two pixels, averaged over channels.
#[cube]
fn edge(image: &[f32], n: usize, channels: usize, area: usize, from: usize, to: usize) -> f32 {
    let mut sum = 0.0f32;
    for c in 0..channels {
        let plane = (n * channels + c) * area;
        sum += (image[plane + to] - image[plane + from]).abs();
    }
    (0.0f32 - sum / (channels as f32)).exp()
}

/// Each group's share of an image's sums: of its disparity, and of its weighted differences over their counts.
#[cube(launch)]
fn image_sums(
    disparity: &[f32],
    image: &[f32],
    shares: &mut [f32],
    channels: usize,
    width: usize,
    area: usize,
    per_x: f32,
    per_y: f32,
    #[comptime] threads: u32,
) {
    let n = CUBE_POS_Y as usize;
    let mut total = 0.0f32;
    let mut terms = 0.0f32;
    let mut pixel = ABSOLUTE_POS_X as usize;
    let stride = (CUBE_COUNT_X * threads) as usize;
    while pixel < area {
        let d = disparity[n * area + pixel];
        total += d;
        if pixel % width + 1 < width {
            let weight = edge(image, n, channels, area, pixel, pixel + 1);
            terms += (disparity[n * area + pixel + 1] - d).abs() * weight * per_x;
        }
        if pixel + width < area {
            let weight = edge(image, n, channels, area, pixel, pixel + width);
            terms += (disparity[n * area + pixel + width] - d).abs() * weight * per_y;
        }
        pixel += stride;
    }
    let total = over_group(total, threads);
    sync_cube();
    let terms = over_group(terms, threads);
    if UNIT_POS == 0 {
        let share = (n * CUBE_COUNT_X as usize + CUBE_POS_X as usize) * 2;
        shares[share] = total;
        shares[share + 1] = terms;
    }
}

/// The sum over the images of the weighted differences divided by the mean disparity.
#[cube(launch)]
fn over_means(sums: &[f32], out: &mut [f32], batch: usize, area: usize) {
    let mut loss = 0.0f32;
    for n in 0..batch {
        loss += sums[2 * n + 1] / (sums[2 * n] / (area as f32) + EPSILON);
    }
    if UNIT_POS == 0 {
        out[0] = loss;
    }
}

/// The derivative of the weighted difference of two pixels with respect to the disparity at `to`.
#[cube]
fn pull(
    disparity: &[f32],
    image: &[f32],
    n: usize,
    channels: usize,
    area: usize,
    from: usize,
    to: usize,
) -> f32 {
    let (a, b) = (disparity[n * area + from], disparity[n * area + to]);
    let sign = select(b > a, 1.0f32, 0.0f32) - select(b < a, 1.0f32, 0.0f32);
    sign * edge(image, n, channels, area, from, to)
}

#[cube(launch)]
fn gradient(
    disparity: &[f32],
    image: &[f32],
    sums: &[f32],
    grad: &[f32],
    out: &mut [f32],
    channels: usize,
    width: usize,
    area: usize,
    per_x: f32,
    per_y: f32,
) {
    let pixel = ABSOLUTE_POS_X as usize;
    if pixel >= area {
        terminate!();
    }
    let n = plane_of_group();
    let mean = sums[2 * n] / (area as f32) + EPSILON;
    // Through the mean, which every pixel changes equally.
    let through_mean = 0.0f32 - sums[2 * n + 1] / (mean * mean * (area as f32));
    let column = pixel % width;
    let mut along_x = 0.0f32;
    let mut along_y = 0.0f32;
    if column > 0 {
        along_x += pull(disparity, image, n, channels, area, pixel - 1, pixel);
    }
    if column + 1 < width {
        along_x += pull(disparity, image, n, channels, area, pixel + 1, pixel);
    }
    if pixel >= width {
        along_y += pull(disparity, image, n, channels, area, pixel - width, pixel);
    }
    if pixel + width < area {
        along_y += pull(disparity, image, n, channels, area, pixel + width, pixel);
    }
    let direct = (along_x * per_x + along_y * per_y) / mean;
    out[n * area + pixel] = grad[0] * (through_mean + direct);
}

/// One over the number of differences along x and along y, over all images.
fn per_difference([batch, _, height, width]: [usize; 4]) -> (f32, f32) {
    let per = |count: usize| 1.0f32 / (batch * count).max(1) as f32;
    (per(height * (width - 1)), per((height - 1) * width))
}

/// [`image_sums`] of each image, N×2.
fn sums(disparity: CubeTensor, image: CubeTensor) -> CubeTensor {
    let sizes @ [batch, channels, height, width] = dims(&image);
    let (per_x, per_y) = per_difference(sizes);
    let shares = room(&disparity, [batch, SUM_GROUPS as usize, 2]);
    let (count, dim) = summing(SUM_GROUPS, batch);
    image_sums::launch(
        &shares.client,
        count,
        dim,
        input(disparity),
        input(image),
        output(&shares),
        channels,
        width,
        height * width,
        per_x,
        per_y,
        SUM_THREADS,
    );
    CubeBackend::float_sum_dim(shares, 1)
}

pub(super) fn forward(disparity: CubeTensor, image: CubeTensor) -> CubeTensor {
    let [batch, _, height, width] = dims(&disparity);
    let out = room(&disparity, [1]);
    let sums = sums(disparity, image);
    let one = (CubeCount::Static(1, 1, 1), CubeDim::new_1d(1));
    over_means::launch(
        &out.client,
        one.0,
        one.1,
        input(sums),
        output(&out),
        batch,
        height * width,
    );
    out
}

pub(super) fn backward(disparity: CubeTensor, image: CubeTensor, grad: CubeTensor) -> CubeTensor {
    let sizes @ [batch, channels, height, width] = dims(&image);
    let (per_x, per_y) = per_difference(sizes);
    let [disparity, image] = [disparity, image].map(into_contiguous);
    let out = room(&disparity, [batch, 1, height, width]);
    let sums = sums(disparity.clone(), image.clone());
    let (count, dim) = along_pixels(height * width, batch);
    gradient::launch(
        &out.client,
        count,
        dim,
        input(disparity),
        input(image),
        input(sums),
        input(grad),
        output(&out),
        channels,
        width,
        height * width,
        per_x,
        per_y,
    );
    out
}
