//! Projection of one view's pixels into another (the paper's Eq. 3–5).

use super::grid::{over_group, plane_of_group};
use super::{SUM_GROUPS, SUM_THREADS, along_pixels, dims, input, output, room, summing};
use burn::backend::ops::FloatTensorOps;
use burn_cubecl::CubeBackend;
use burn_cubecl::cubecl;
use burn_cubecl::cubecl::prelude::*;
use burn_cubecl::tensor::CubeTensor;
use deepfusion_kernels::{MIN_DEPTH_M, NOWHERE};

/// Row `row` of H·p̃ + d·s.
#[cube]
fn row(
    homography: &[f32],
    shift: &[f32],
    image: usize,
    #[comptime] row: usize,
    x: f32,
    y: f32,
    disparity: f32,
) -> f32 {
    let h = 9 * image + comptime!(3 * row);
    let turned = homography[h] * x + homography[h + 1] * y + homography[h + 2];
    turned + disparity * shift[3 * image + row]
}

#[cube(launch)]
fn project(
    disparity: &[f32],
    homography: &[f32],
    shift: &[f32],
    coords: &mut [f32],
    width: usize,
    area: usize,
    least: f32,
    nowhere: f32,
) {
    let pixel = ABSOLUTE_POS_X as usize;
    if pixel >= area {
        terminate!();
    }
    let image = plane_of_group();
    let (x, y) = ((pixel % width) as f32, (pixel / width) as f32);
    let d = disparity[image * area + pixel];
    let u = row(homography, shift, image, 0usize, x, y, d);
    let v = row(homography, shift, image, 1usize, x, y, d);
    let w = row(homography, shift, image, 2usize, x, y, d);
    let front = w > d * least;
    let depth = select(front, w, 1.0f32);
    let at = 2 * image * area + pixel;
    coords[at] = select(front, u / depth, nowhere);
    coords[at + area] = select(front, v / depth, nowhere);
}

/// The gradient of the disparity, and each group's share of those of H and s: twelve sums, row by row.
#[cube(launch)]
fn project_backward(
    disparity: &[f32],
    homography: &[f32],
    shift: &[f32],
    grad: &[f32],
    grad_disparity: &mut [f32],
    shares: &mut [f32],
    width: usize,
    area: usize,
    least: f32,
    #[comptime] threads: u32,
) {
    let image = CUBE_POS_Y as usize;
    let mut sums = Array::<f32>::new(12usize);
    #[unroll]
    for i in 0..12usize {
        sums[i] = 0.0f32;
    }
    let mut pixel = ABSOLUTE_POS_X as usize;
    let stride = (CUBE_COUNT_X * threads) as usize;
    while pixel < area {
        let (x, y) = ((pixel % width) as f32, (pixel / width) as f32);
        let d = disparity[image * area + pixel];
        let w = row(homography, shift, image, 2usize, x, y, d);
        let front = w > d * least;
        let inverse = select(front, 1.0f32 / select(front, w, 1.0f32), 0.0f32);
        let u = row(homography, shift, image, 0usize, x, y, d) * inverse;
        let v = row(homography, shift, image, 1usize, x, y, d) * inverse;
        let at = 2 * image * area + pixel;
        let gu = grad[at] * inverse;
        let gv = grad[at + area] * inverse;
        let gw = 0.0f32 - (gu * u + gv * v);
        grad_disparity[image * area + pixel] =
            gu * shift[3 * image] + gv * shift[3 * image + 1] + gw * shift[3 * image + 2];
        sums[0] += gu * x;
        sums[1] += gu * y;
        sums[2] += gu;
        sums[3] += gv * x;
        sums[4] += gv * y;
        sums[5] += gv;
        sums[6] += gw * x;
        sums[7] += gw * y;
        sums[8] += gw;
        sums[9] += gu * d;
        sums[10] += gv * d;
        sums[11] += gw * d;
        pixel += stride;
    }
    let share = (image * CUBE_COUNT_X as usize + CUBE_POS_X as usize) * 12;
    #[unroll]
    for i in 0..12usize {
        let total = over_group(sums[i], threads);
        if UNIT_POS == 0 {
            shares[share + i] = total;
        }
        sync_cube();
    }
}

/// 1 where a coordinate lies inside an image, 0 elsewhere.
#[cube(launch)]
fn inside(coords: &[f32], out: &mut [f32], area: usize, last_x: f32, last_y: f32) {
    let pixel = ABSOLUTE_POS_X as usize;
    if pixel >= area {
        terminate!();
    }
    let image = plane_of_group();
    let (u, v) = (
        coords[2 * image * area + pixel],
        coords[(2 * image + 1) * area + pixel],
    );
    let within = u >= 0.0f32 && u <= last_x && v >= 0.0f32 && v <= last_y;
    out[image * area + pixel] = select(within, 1.0f32, 0.0f32);
}

pub(super) fn forward(
    disparity: CubeTensor,
    homography: CubeTensor,
    shift: CubeTensor,
) -> CubeTensor {
    let [batch, _, height, width] = dims(&disparity);
    let area = height * width;
    let out = room(&disparity, [batch, 2, height, width]);
    let (count, dim) = along_pixels(area, batch);
    project::launch(
        &out.client,
        count,
        dim,
        input(disparity),
        input(homography),
        input(shift),
        output(&out),
        width,
        area,
        MIN_DEPTH_M as f32,
        NOWHERE as f32,
    );
    out
}

pub(super) fn backward(
    disparity: CubeTensor,
    homography: CubeTensor,
    shift: CubeTensor,
    grad: CubeTensor,
) -> [CubeTensor; 3] {
    let sizes @ [batch, _, height, width] = dims::<4>(&disparity);
    let area = height * width;
    let out = room(&disparity, sizes);
    let shares = room(&disparity, [batch, SUM_GROUPS as usize, 12]);
    let (count, dim) = summing(SUM_GROUPS, batch);
    project_backward::launch(
        &out.client,
        count,
        dim,
        input(disparity),
        input(homography),
        input(shift),
        input(grad),
        output(&out),
        output(&shares),
        width,
        area,
        MIN_DEPTH_M as f32,
        SUM_THREADS,
    );
    let sums =
        CubeBackend::float_reshape(CubeBackend::float_sum_dim(shares, 1), [batch, 12].into());
    let part = |from: usize, to: usize| {
        let slices = [(0..batch).into(), (from..to).into()];
        CubeBackend::float_slice(sums.clone(), &slices)
    };
    let homography = CubeBackend::float_reshape(part(0, 9), [batch, 3, 3].into());
    [out, homography, part(9, 12)]
}

pub(super) fn in_view(coords: CubeTensor, height: usize, width: usize) -> CubeTensor {
    let [batch, _, out_height, out_width] = dims(&coords);
    let area = out_height * out_width;
    let out = room(&coords, [batch, 1, out_height, out_width]);
    let (count, dim) = along_pixels(area, batch);
    inside::launch(
        &out.client,
        count,
        dim,
        input(coords),
        output(&out),
        area,
        (width - 1) as f32,
        (height - 1) as f32,
    );
    out
}
