//! The photometric error (the paper's Eq. 6).

use super::grid::plane_of_group;
use super::{along_pixels, dims, input, output, room};
use burn_cubecl::cubecl;
use burn_cubecl::cubecl::prelude::*;
use burn_cubecl::kernel::into_contiguous;
use burn_cubecl::tensor::CubeTensor;

const C1: f32 = deepfusion_kernels::SSIM_C1 as f32;
const C2: f32 = deepfusion_kernels::SSIM_C2 as f32;

/// The pixel for a coordinate at most one beyond the image, which is mirrored without repeating its edge.
#[cube]
fn mirrored(at: i32, size: i32) -> i32 {
    let last = size - 1;
    let ahead = select(at < 0, 0 - at, at);
    select(ahead > last, 2 * last - ahead, ahead)
}

/// The sums of a 3×3 window: a, b, a², b², ab.
#[cube]
fn window(
    a: &[f32],
    b: &[f32],
    plane: usize,
    y: i32,
    x: i32,
    height: i32,
    width: i32,
) -> Array<f32> {
    let mut sums = Array::<f32>::new(5usize);
    #[unroll]
    for i in 0..5usize {
        sums[i] = 0.0f32;
    }
    #[unroll]
    for row in 0..3i32 {
        let line = plane + (mirrored(y + row - 1, height) * width) as usize;
        #[unroll]
        for column in 0..3i32 {
            let at = line + mirrored(x + column - 1, width) as usize;
            let (p, q) = (a[at], b[at]);
            sums[0] += p;
            sums[1] += q;
            sums[2] += p * p;
            sums[3] += q * q;
            sums[4] += p * q;
        }
    }
    sums
}

/// SSIM = a₁·a₂ / (b₁·b₂) of the window around a pixel.
#[derive(CubeType)]
struct Similarity {
    mu_a: f32,
    mu_b: f32,
    a1: f32,
    a2: f32,
    b1: f32,
    b2: f32,
    ssim: f32,
}

#[cube]
fn similarity(
    a: &[f32],
    b: &[f32],
    plane: usize,
    y: i32,
    x: i32,
    height: i32,
    width: i32,
) -> Similarity {
    let sums = window(a, b, plane, y, x, height, width);
    let (mu_a, mu_b) = (sums[0] / 9.0f32, sums[1] / 9.0f32);
    let a1 = 2.0f32 * mu_a * mu_b + C1;
    let a2 = 2.0f32 * (sums[4] / 9.0f32 - mu_a * mu_b) + C2;
    let b1 = mu_a * mu_a + mu_b * mu_b + C1;
    let b2 = (sums[2] / 9.0f32 - mu_a * mu_a) + (sums[3] / 9.0f32 - mu_b * mu_b) + C2;
    Similarity {
        mu_a,
        mu_b,
        a1,
        a2,
        b1,
        b2,
        ssim: (a1 * a2) / (b1 * b2),
    }
}

#[cube(launch)]
fn error(
    a: &[f32],
    b: &[f32],
    out: &mut [f32],
    channels: usize,
    height: usize,
    width: usize,
    alpha: f32,
) {
    let area = height * width;
    let pixel = ABSOLUTE_POS_X as usize;
    if pixel >= area {
        terminate!();
    }
    let n = plane_of_group();
    let (y, x) = ((pixel / width) as i32, (pixel % width) as i32);
    let mut sum = 0.0f32;
    for c in 0..channels {
        let plane = (n * channels + c) * area;
        let ssim = similarity(a, b, plane, y, x, height as i32, width as i32).ssim;
        let dissimilar = ((1.0f32 - ssim) * 0.5f32).clamp(0.0f32, 1.0f32);
        let difference = (a[plane + pixel] - b[plane + pixel]).abs();
        sum += alpha * dissimilar + (1.0f32 - alpha) * difference;
    }
    out[n * area + pixel] = sum / (channels as f32);
}

/// The derivatives of the loss with respect to each window's means of a, a² and ab.
#[cube(launch)]
fn window_gradients(
    a: &[f32],
    b: &[f32],
    grad: &[f32],
    of_mean: &mut [f32],
    of_square: &mut [f32],
    of_product: &mut [f32],
    channels: usize,
    height: usize,
    width: usize,
    alpha: f32,
) {
    let area = height * width;
    let pixel = ABSOLUTE_POS_X as usize;
    if pixel >= area {
        terminate!();
    }
    let plane = plane_of_group();
    let (y, x) = ((pixel / width) as i32, (pixel % width) as i32);
    let terms = similarity(a, b, plane * area, y, x, height as i32, width as i32);
    let ssim = terms.ssim;
    // Outside the clamp the gradient is zero.
    let inside = ssim < 1.0f32 && ssim > -1.0f32;
    let scale = 0.0f32 - 0.5f32 * alpha / (channels as f32);
    let g = select(
        inside,
        scale * grad[plane / channels * area + pixel],
        0.0f32,
    );
    let (b1, b2) = (terms.b1, terms.b2);
    let through_mean = 2.0f32 * terms.mu_b * (terms.a2 - terms.a1) / (b1 * b2)
        - ssim * 2.0f32 * terms.mu_a * (1.0f32 / b1 - 1.0f32 / b2);
    let at = plane * area + pixel;
    of_mean[at] = g * through_mean;
    of_square[at] = 0.0f32 - g * ssim / b2;
    of_product[at] = g * 2.0f32 * terms.a1 / (b1 * b2);
}

/// How often the window around `centre` reads the pixel `at`, at most one away: twice at a mirrored edge.
#[cube]
fn times(centre: i32, at: i32, size: i32) -> f32 {
    let first = select(centre == 0 && at == 1, 1.0f32, 0.0f32);
    let last = select(centre == size - 1 && at == size - 2, 1.0f32, 0.0f32);
    1.0f32 + first + last
}

/// A pixel's gradient from the windows that read it, and from the absolute difference.
#[cube(launch)]
fn image_gradient(
    a: &[f32],
    b: &[f32],
    grad: &[f32],
    of_mean: &[f32],
    of_square: &[f32],
    of_product: &[f32],
    out: &mut [f32],
    channels: usize,
    height: usize,
    width: usize,
    alpha: f32,
) {
    let area = height * width;
    let pixel = ABSOLUTE_POS_X as usize;
    if pixel >= area {
        terminate!();
    }
    let plane = plane_of_group();
    let (h, w) = (height as i32, width as i32);
    let (y, x) = ((pixel / width) as i32, (pixel % width) as i32);
    let mut mean = 0.0f32;
    let mut square = 0.0f32;
    let mut product = 0.0f32;
    #[unroll]
    for row in 0..3i32 {
        let centre_y = y + row - 1;
        #[unroll]
        for column in 0..3i32 {
            let centre_x = x + column - 1;
            if centre_y >= 0 && centre_y < h && centre_x >= 0 && centre_x < w {
                let weight = times(centre_y, y, h) * times(centre_x, x, w);
                let at = plane * area + (centre_y * w + centre_x) as usize;
                mean += weight * of_mean[at];
                square += weight * of_square[at];
                product += weight * of_product[at];
            }
        }
    }
    let at = plane * area + pixel;
    let (p, q) = (a[at], b[at]);
    let sign = select(p > q, 1.0f32, 0.0f32) - select(p < q, 1.0f32, 0.0f32);
    let direct =
        (1.0f32 - alpha) / (channels as f32) * grad[plane / channels * area + pixel] * sign;
    out[at] = (mean + 2.0f32 * p * square + q * product) / 9.0f32 + direct;
}

pub(super) fn forward(a: CubeTensor, b: CubeTensor, alpha: f64) -> CubeTensor {
    let [batch, channels, height, width] = dims(&a);
    let out = room(&a, [batch, 1, height, width]);
    let (count, dim) = along_pixels(height * width, batch);
    error::launch(
        &out.client,
        count,
        dim,
        input(a),
        input(b),
        output(&out),
        channels,
        height,
        width,
        alpha as f32,
    );
    out
}

pub(super) fn backward(a: CubeTensor, b: CubeTensor, grad: CubeTensor, alpha: f64) -> CubeTensor {
    let sizes @ [batch, channels, height, width] = dims::<4>(&a);
    let out = room(&a, sizes);
    let client = out.client.clone();
    let [a, b, grad] = [a, b, grad].map(into_contiguous);
    let [of_mean, of_square, of_product] = [(); 3].map(|()| room(&a, sizes));
    let (count, dim) = along_pixels(height * width, batch * channels);
    window_gradients::launch(
        &client,
        count.clone(),
        dim,
        input(a.clone()),
        input(b.clone()),
        input(grad.clone()),
        output(&of_mean),
        output(&of_square),
        output(&of_product),
        channels,
        height,
        width,
        alpha as f32,
    );
    image_gradient::launch(
        &client,
        count,
        dim,
        input(a),
        input(b),
        input(grad),
        input(of_mean),
        input(of_square),
        input(of_product),
        output(&out),
        channels,
        height,
        width,
        alpha as f32,
    );
    out
}
