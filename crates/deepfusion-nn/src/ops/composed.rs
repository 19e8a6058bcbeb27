//! The operations composed of Burn's own. Backends without kernels run them, and the kernels are tested against them.

use super::{AdamFactors, BatchNormOutput, ConvOptions};
use burn::tensor::{
    Bool, Int, Tensor,
    module::{avg_pool2d, max_pool2d},
    ops::{AvgPoolOptions, ConvOptions as BurnConvOptions, MaxPoolOptions, PadMode},
};
use deepfusion_kernels::{AdamStep, MIN_DEPTH_M, NOWHERE, SSIM_C1, SSIM_C2};

/// [`super::conv2d`].
#[must_use]
pub fn conv2d(
    x: Tensor<4>,
    weight: Tensor<4>,
    bias: Option<Tensor<1>>,
    options: ConvOptions,
) -> Tensor<4> {
    let (x, padding) = if options.reflect && options.padding > 0 {
        (mirror(x, options.padding), 0)
    } else {
        (x, options.padding)
    };
    let (s, d) = (options.stride, options.dilation);
    let options = BurnConvOptions::new([s, s], [padding, padding], [d, d], 1);
    burn::tensor::module::conv2d(x, weight, bias, options)
}

fn mirror(x: Tensor<4>, padding: usize) -> Tensor<4> {
    x.pad((padding, padding, padding, padding), PadMode::Reflect)
}

/// [`super::batch_norm`].
#[must_use]
pub fn batch_norm(
    x: Tensor<4>,
    gamma: Tensor<1>,
    beta: Tensor<1>,
    epsilon: f64,
    relu: bool,
) -> BatchNormOutput {
    let [batch, channels, height, width] = x.dims();
    let per_channel = |t: Tensor<1>| t.reshape([1, channels, 1, 1]);
    let mean_of = |t: Tensor<4>| {
        t.swap_dims(0, 1)
            .reshape([channels, batch * height * width])
            .mean_dim(1)
            .reshape([channels])
    };
    let mean = mean_of(x.clone());
    let centred = x.sub(per_channel(mean.clone()));
    let variance = mean_of(centred.clone().powi_scalar(2));
    let deviation = variance.clone().add_scalar(epsilon).sqrt();
    let scale = gamma.div(deviation);
    let output = centred.mul(per_channel(scale)).add(per_channel(beta));
    BatchNormOutput {
        output: if relu {
            burn::tensor::activation::relu(output)
        } else {
            output
        },
        mean: mean.detach(),
        variance: variance.detach(),
    }
}

/// [`super::running_statistics`].
#[must_use]
pub fn running_statistics(
    [mean, variance]: [Tensor<1>; 2],
    [batch_mean, batch_variance]: [Tensor<1>; 2],
    momentum: f64,
    unbiased: f64,
) -> [Tensor<1>; 2] {
    let towards = |running: Tensor<1>, batch: Tensor<1>| {
        let kept = running.mul_scalar(1.0 - momentum);
        kept.add(batch.mul_scalar(momentum)).detach()
    };
    [
        towards(mean, batch_mean),
        towards(variance, batch_variance.mul_scalar(unbiased)),
    ]
}

/// [`super::depthwise`].
#[must_use]
pub fn depthwise(x: Tensor<4>, weight: Tensor<4>, dilation: usize) -> Tensor<4> {
    let [channels, _, kernel, _] = weight.dims();
    let (padding, d) = (kernel / 2 * dilation, dilation);
    let options = BurnConvOptions::new([1, 1], [padding, padding], [d, d], channels);
    burn::tensor::module::conv2d(x, weight, None, options)
}

/// [`super::gelu`].
#[must_use]
pub fn gelu(x: Tensor<4>) -> Tensor<4> {
    burn::tensor::activation::gelu(x)
}

/// [`super::elu`], as relu(x) + e^(−relu(−x)) − 1: the exponential's argument is never positive, so that large activations cannot become
/// infinite with a NaN gradient.
#[must_use]
pub fn elu(x: Tensor<4>) -> Tensor<4> {
    let below = burn::tensor::activation::relu(x.clone().neg())
        .neg()
        .exp()
        .sub_scalar(1.0);
    burn::tensor::activation::relu(x).add(below)
}

/// [`super::add_relu`].
#[must_use]
pub fn add_relu(a: Tensor<4>, b: Tensor<4>) -> Tensor<4> {
    burn::tensor::activation::relu(a.add(b))
}

/// [`super::sigmoid`].
#[must_use]
pub fn sigmoid(x: Tensor<4>) -> Tensor<4> {
    burn::tensor::activation::sigmoid(x)
}

/// [`super::max_pool_3x3_stride_2`].
#[must_use]
pub fn max_pool_3x3_stride_2(x: Tensor<4>) -> Tensor<4> {
    let options = MaxPoolOptions::new([3, 3]);
    max_pool2d(x, options.with_stride([2, 2]).with_padding([1, 1]))
}

/// [`super::upsample_concat`].
#[must_use]
pub fn upsample_concat(x: Tensor<4>, skip: Option<Tensor<4>>) -> Tensor<4> {
    let [batch, channels, height, width] = x.dims();
    let large = x
        .reshape([batch * channels, height, 1, width, 1])
        .expand([batch * channels, height, 2, width, 2])
        .reshape([batch, channels, 2 * height, 2 * width]);
    match skip {
        Some(skip) => Tensor::cat(vec![large, skip], 1),
        None => large,
    }
}

/// [`super::warp`].
#[must_use]
pub fn warp(image: Tensor<4>, coords: Tensor<4>) -> Tensor<4> {
    let [batch, channels, height, width] = image.dims();
    let [_, _, out_height, out_width] = coords.dims();
    let area = out_height * out_width;
    let flat = image.reshape([batch, channels, height * width]);
    let axis = |index: usize, size: usize| {
        let last = (size - 1) as f64;
        let p = coords
            .clone()
            .slice([0..batch, index..index + 1])
            .reshape([batch, 1, area])
            .clamp(0.0, last);
        let low = p.clone().detach().floor().clamp(0.0, (last - 1.0).max(0.0));
        (low.clone().int(), p.sub(low))
    };
    let ((x0, fx), (y0, fy)) = (axis(0, width), axis(1, height));
    let (right, down) = (i64::from(width > 1), i64::from(height > 1));
    let read = |dx: i64, dy: i64| {
        let index: Tensor<3, Int> = y0
            .clone()
            .add_scalar(dy)
            .mul_scalar(width as i64)
            .add(x0.clone().add_scalar(dx));
        flat.clone()
            .gather(2, index.expand([batch, channels, area]))
    };
    let mix = |a: Tensor<3>, b: Tensor<3>, f: Tensor<3>| a.clone().add(b.sub(a).mul(f));
    let top = mix(read(0, 0), read(right, 0), fx.clone());
    let bottom = mix(read(0, down), read(right, down), fx);
    mix(top, bottom, fy).reshape([batch, channels, out_height, out_width])
}

/// [`super::local_correlation`].
#[must_use]
pub fn local_correlation(first: Tensor<4>, second: Tensor<4>, radius: usize) -> Tensor<4> {
    let [_, _, height, width] = first.dims();
    let side = 2 * radius + 1;
    let margin = (radius, radius, radius, radius);
    let second = second.pad(margin, PadMode::Constant(0.0));
    let products = (0..side * side).map(|d| {
        let shifted = second
            .clone()
            .narrow(2, d / side, height)
            .narrow(3, d % side, width);
        first.clone().mul(shifted).mean_dim(1)
    });
    Tensor::cat(products.collect(), 1)
}

/// [`super::photometric_error`].
#[must_use]
pub fn photometric_error(a: Tensor<4>, b: Tensor<4>, alpha: f64) -> Tensor<4> {
    let b = b.detach();
    let window = AvgPoolOptions::new([3, 3]).with_stride([1, 1]);
    let mean = |t: Tensor<4>| avg_pool2d(mirror(t, 1), window.clone());
    let (mu_a, mu_b) = (mean(a.clone()), mean(b.clone()));
    let var_a = mean(a.clone().mul(a.clone())).sub(mu_a.clone().mul(mu_a.clone()));
    let var_b = mean(b.clone().mul(b.clone())).sub(mu_b.clone().mul(mu_b.clone()));
    let product = mu_a.clone().mul(mu_b.clone());
    let covariance = mean(a.clone().mul(b.clone())).sub(product.clone());
    let numerator = product
        .mul_scalar(2.0)
        .add_scalar(SSIM_C1)
        .mul(covariance.mul_scalar(2.0).add_scalar(SSIM_C2));
    let denominator = mu_a
        .powi_scalar(2)
        .add(mu_b.powi_scalar(2))
        .add_scalar(SSIM_C1)
        .mul(var_a.add(var_b).add_scalar(SSIM_C2));
    let dissimilar = numerator
        .div(denominator)
        .neg()
        .add_scalar(1.0)
        .mul_scalar(0.5)
        .clamp(0.0, 1.0);
    dissimilar
        .mul_scalar(alpha)
        .add(a.sub(b).abs().mul_scalar(1.0 - alpha))
        .mean_dim(1)
}

/// [`super::project`].
#[must_use]
pub fn project(disparity: Tensor<4>, homography: Tensor<3>, shift: Tensor<2>) -> Tensor<4> {
    let [n, _, height, width] = disparity.dims();
    let device = disparity.device().inner();
    let along = |size: usize| {
        let steps: Tensor<1> = Tensor::<1, Int>::arange(0..size as i64, &device).float();
        steps
    };
    let x = along(width).reshape([1, 1, 1, width]);
    let y = along(height).reshape([1, 1, height, 1]);
    let entry = |row: usize, column: usize| {
        let one = homography
            .clone()
            .slice([0..n, row..row + 1, column..column + 1]);
        one.reshape([n, 1, 1, 1])
    };
    let axis = |row: usize| {
        let s = shift
            .clone()
            .slice([0..n, row..row + 1])
            .reshape([n, 1, 1, 1]);
        x.clone() * entry(row, 0)
            + y.clone() * entry(row, 1)
            + entry(row, 2)
            + disparity.clone() * s
    };
    let w = axis(2);
    let behind = w
        .clone()
        .lower_equal(disparity.clone().mul_scalar(MIN_DEPTH_M));
    let w = w.mask_fill(behind.clone(), 1.0);
    let coords = [0, 1].map(|row| axis(row).div(w.clone()).mask_fill(behind.clone(), NOWHERE));
    Tensor::cat(coords.to_vec(), 1)
}

/// [`super::in_view`].
#[must_use]
pub(super) fn in_view(coords: Tensor<4>, size: [usize; 2]) -> Tensor<4, Bool> {
    let inside = |axis: usize, size: usize| {
        let p = coords.clone().narrow(1, axis, 1);
        p.clone()
            .greater_equal_elem(0.0)
            .bool_and(p.lower_equal_elem((size - 1) as f64))
    };
    inside(0, size[1]).bool_and(inside(1, size[0]))
}

/// [`super::smoothness`].
#[must_use]
pub fn smoothness(disparity: Tensor<4>, image: Tensor<4>) -> Tensor<1> {
    let mean = disparity.clone().mean_dim(2).mean_dim(3).add_scalar(1e-7);
    let normalised = disparity.div(mean);
    let along = |axis: usize| {
        let difference = |t: Tensor<4>| {
            let size = t.dims()[axis];
            t.clone()
                .narrow(axis, 1, size - 1)
                .sub(t.narrow(axis, 0, size - 1))
                .abs()
        };
        let edge = difference(image.clone()).mean_dim(1).neg().exp();
        difference(normalised.clone()).mul(edge).mean()
    };
    along(3) + along(2)
}

/// [`super::adam`].
#[must_use]
pub fn adam(
    step: &AdamStep,
    factors: &AdamFactors,
    values: Tensor<1>,
    gradient: Tensor<1>,
    moments: [Tensor<1>; 2],
) -> (Tensor<1>, [Tensor<1>; 2]) {
    let [scale, correction1, correction2, is_made] = factors.each();
    let [old_first, old_second] = moments;
    let gradient = gradient.mul(scale);
    let squared = gradient.clone() * gradient.clone();
    let first = old_first.clone().mul_scalar(step.beta1) + gradient.mul_scalar(1.0 - step.beta1);
    let second = old_second.clone().mul_scalar(step.beta2) + squared.mul_scalar(1.0 - step.beta2);
    let root = second.clone().div(correction2).sqrt();
    let direction = first.clone().div(correction1) / root.add_scalar(step.epsilon);
    let kept = values
        .clone()
        .mul_scalar(1.0 - step.learning_rate * step.weight_decay);
    let moved = kept - direction.mul_scalar(step.learning_rate);
    // Selected, not multiplied, so that a NaN gradient has no effect.
    let stays = is_made.lower_elem(0.5).expand(values.dims());
    let chosen = |new: Tensor<1>, old: Tensor<1>| new.mask_where(stays.clone(), old);
    (
        chosen(moved, values),
        [chosen(first, old_first), chosen(second, old_second)],
    )
}
