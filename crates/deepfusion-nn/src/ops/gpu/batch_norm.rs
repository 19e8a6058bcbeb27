//! Batch normalisation with the batch's own statistics, and the ReLU after it.

use super::grid::{over_group, plane_of_group};
use super::{SUM_THREADS, along_pixels, dims, input, output, room, summing, values};
use burn_cubecl::cubecl;
use burn_cubecl::cubecl::prelude::*;
use burn_cubecl::tensor::CubeTensor;

/// Mean and variance of the channels, with a group of threads for each channel. The variance is computed from the differences, in a second
/// pass.
#[cube(launch)]
fn moments(
    x: &[f32],
    mean: &mut [f32],
    variance: &mut [f32],
    batch: usize,
    area: usize,
    #[comptime] threads: u32,
) {
    let channel = CUBE_POS_Y as usize;
    let channels = mean.len();
    let count = (batch * area) as f32;
    let mut sum = 0.0f32;
    for image in 0..batch {
        let plane = (image * channels + channel) * area;
        let mut at = UNIT_POS as usize;
        while at < area {
            sum += x[plane + at];
            at += threads as usize;
        }
    }
    let middle = over_group(sum, threads) / count;
    sync_cube();
    let mut squares = 0.0f32;
    for image in 0..batch {
        let plane = (image * channels + channel) * area;
        let mut at = UNIT_POS as usize;
        while at < area {
            let centred = x[plane + at] - middle;
            squares += centred * centred;
            at += threads as usize;
        }
    }
    let spread = over_group(squares, threads) / count;
    if UNIT_POS == 0 {
        mean[channel] = middle;
        variance[channel] = spread;
    }
}

#[cube(launch)]
fn normalise(
    x: &[f32],
    gamma: &[f32],
    beta: &[f32],
    mean: &[f32],
    variance: &[f32],
    out: &mut [f32],
    area: usize,
    epsilon: f32,
    #[comptime] relu: bool,
) {
    let pixel = ABSOLUTE_POS_X as usize;
    if pixel >= area {
        terminate!();
    }
    let plane = plane_of_group();
    let channel = plane % mean.len();
    let at = plane * area + pixel;
    let scale = gamma[channel] / (variance[channel] + epsilon).sqrt();
    let value = (x[at] - mean[channel]) * scale + beta[channel];
    if comptime!(relu) {
        // NaN stays NaN; a maximum would hide it.
        out[at] = select(value <= 0.0f32, 0.0f32, value);
    } else {
        out[at] = value;
    }
}

/// The gradients of γ and β: sums over a channel of the gradient, and of the gradient and the normalised values.
#[cube(launch)]
fn parameter_gradients(
    x: &[f32],
    gamma: &[f32],
    beta: &[f32],
    mean: &[f32],
    variance: &[f32],
    grad: &[f32],
    grad_gamma: &mut [f32],
    grad_beta: &mut [f32],
    batch: usize,
    area: usize,
    epsilon: f32,
    #[comptime] relu: bool,
    #[comptime] threads: u32,
) {
    let channel = CUBE_POS_Y as usize;
    let channels = mean.len();
    let middle = mean[channel];
    let per_deviation = 1.0f32 / (variance[channel] + epsilon).sqrt();
    let (factor, offset) = (gamma[channel], beta[channel]);
    let mut of_gamma = 0.0f32;
    let mut of_beta = 0.0f32;
    for image in 0..batch {
        let plane = (image * channels + channel) * area;
        let mut at = UNIT_POS as usize;
        while at < area {
            let normal = (x[plane + at] - middle) * per_deviation;
            let mut g = grad[plane + at];
            if comptime!(relu) {
                g = select(factor * normal + offset > 0.0f32, g, 0.0f32);
            }
            of_gamma += g * normal;
            of_beta += g;
            at += threads as usize;
        }
    }
    let of_gamma = over_group(of_gamma, threads);
    sync_cube();
    let of_beta = over_group(of_beta, threads);
    if UNIT_POS == 0 {
        grad_gamma[channel] = of_gamma;
        grad_beta[channel] = of_beta;
    }
}

/// ∂x = γ/σ·(g − mean(g) − x̂·mean(g·x̂)).
#[cube(launch)]
fn input_gradient(
    x: &[f32],
    gamma: &[f32],
    beta: &[f32],
    mean: &[f32],
    variance: &[f32],
    grad: &[f32],
    grad_gamma: &[f32],
    grad_beta: &[f32],
    out: &mut [f32],
    batch: usize,
    area: usize,
    epsilon: f32,
    #[comptime] relu: bool,
) {
    let pixel = ABSOLUTE_POS_X as usize;
    if pixel >= area {
        terminate!();
    }
    let plane = plane_of_group();
    let channel = plane % mean.len();
    let at = plane * area + pixel;
    let count = (batch * area) as f32;
    let per_deviation = 1.0f32 / (variance[channel] + epsilon).sqrt();
    let normal = (x[at] - mean[channel]) * per_deviation;
    let mut g = grad[at];
    if comptime!(relu) {
        g = select(gamma[channel] * normal + beta[channel] > 0.0f32, g, 0.0f32);
    }
    let moved = grad_beta[channel] / count + normal * grad_gamma[channel] / count;
    out[at] = gamma[channel] * per_deviation * (g - moved);
}

#[cube(launch)]
fn running_statistics(
    mean: &[f32],
    variance: &[f32],
    batch_mean: &[f32],
    batch_variance: &[f32],
    new_mean: &mut [f32],
    new_variance: &mut [f32],
    momentum: f32,
    unbiased: f32,
) {
    let channel = ABSOLUTE_POS;
    if channel >= mean.len() {
        terminate!();
    }
    let kept = 1.0f32 - momentum;
    let unbiased_variance = batch_variance[channel] * unbiased;
    new_mean[channel] = mean[channel] * kept + batch_mean[channel] * momentum;
    new_variance[channel] = variance[channel] * kept + unbiased_variance * momentum;
}

pub(super) fn running(
    [mean, variance]: [CubeTensor; 2],
    [batch_mean, batch_variance]: [CubeTensor; 2],
    momentum: f32,
    unbiased: f32,
) -> (CubeTensor, CubeTensor) {
    let channels: [usize; 1] = dims(&mean);
    let (new_mean, new_variance) = (room(&mean, channels), room(&mean, channels));
    let (count, dim) = values(&new_mean);
    running_statistics::launch(
        &new_mean.client,
        count,
        dim,
        input(mean),
        input(variance),
        input(batch_mean),
        input(batch_variance),
        output(&new_mean),
        output(&new_variance),
        momentum,
        unbiased,
    );
    (new_mean, new_variance)
}

pub(super) fn forward(
    x: CubeTensor,
    gamma: CubeTensor,
    beta: CubeTensor,
    epsilon: f32,
    relu: bool,
) -> (CubeTensor, CubeTensor, CubeTensor) {
    let sizes @ [batch, channels, height, width] = dims(&x);
    let area = height * width;
    let (mean, variance) = (room(&x, [channels]), room(&x, [channels]));
    let out = room(&x, sizes);
    let client = out.client.clone();
    let x = burn_cubecl::kernel::into_contiguous(x);
    let (count, dim) = summing(1, channels);
    moments::launch(
        &client,
        count,
        dim,
        input(x.clone()),
        output(&mean),
        output(&variance),
        batch,
        area,
        SUM_THREADS,
    );
    let (count, dim) = along_pixels(area, batch * channels);
    normalise::launch(
        &client,
        count,
        dim,
        input(x),
        input(gamma),
        input(beta),
        input(mean.clone()),
        input(variance.clone()),
        output(&out),
        area,
        epsilon,
        relu,
    );
    (out, mean, variance)
}

pub(super) fn backward(
    x: CubeTensor,
    [gamma, beta]: [CubeTensor; 2],
    [mean, variance]: [CubeTensor; 2],
    grad: CubeTensor,
    epsilon: f32,
    relu: bool,
) -> [CubeTensor; 3] {
    let sizes @ [batch, channels, height, width] = dims(&x);
    let area = height * width;
    let (grad_gamma, grad_beta) = (room(&x, [channels]), room(&x, [channels]));
    let out = room(&x, sizes);
    let client = out.client.clone();
    let [x, grad] = [x, grad].map(burn_cubecl::kernel::into_contiguous);
    let (count, dim) = summing(1, channels);
    parameter_gradients::launch(
        &client,
        count,
        dim,
        input(x.clone()),
        input(gamma.clone()),
        input(beta.clone()),
        input(mean.clone()),
        input(variance.clone()),
        input(grad.clone()),
        output(&grad_gamma),
        output(&grad_beta),
        batch,
        area,
        epsilon,
        relu,
        SUM_THREADS,
    );
    let (count, dim) = along_pixels(area, batch * channels);
    input_gradient::launch(
        &client,
        count,
        dim,
        input(x),
        input(gamma),
        input(beta),
        input(mean),
        input(variance),
        input(grad),
        input(grad_gamma.clone()),
        input(grad_beta.clone()),
        output(&out),
        batch,
        area,
        epsilon,
        relu,
    );
    [out, grad_gamma, grad_beta]
}
