//! The project's own differentiable operations.
//!
//! In single precision they run on the kernels of `deepfusion-kernels` on the CPU (Burn's Flex backend), with backward passes of their own,
//! and on kernels in CubeCL's language on a GPU (feature `gpu`); elsewhere they are composed of Burn's operations and compute the same.
//! `kernel` declares them to Burn's dispatch, `flex` and `gpu` run them, `autodiff` differentiates them, and `composed` has the composed
//! form. A few have kernels only on a GPU; they are declared and differentiated beside these kernels.

/// Runs the forward pass and records the step. `$state` is built only if a gradient is needed.
macro_rules! record {
    ($op:expr, $C:ty, $nodes:expr, $output:expr, $state:expr) => {
        match $op.prepare::<$C>($nodes).compute_bound().stateful() {
            OpsKind::Tracked(prep) => prep.finish($state, $output),
            OpsKind::UnTracked(prep) => prep.finish($output),
        }
    };
}

mod adam_factors;
mod autocast;
mod autodiff;
mod composed;
mod flex;
#[cfg(feature = "gpu")]
mod gpu;
mod kernel;

use burn::backend::{Dispatch, DispatchDevice};
use burn::tensor::{Bool, DType, Device, Tensor, TensorData};
use deepfusion_kernels::AdamStep;
use kernel::KernelOps;

pub use adam_factors::AdamFactors;
pub use autocast::{autocast, supports};
pub use composed::{
    adam as composed_adam, add_relu as composed_add_relu, batch_norm as composed_batch_norm,
    conv2d as composed_conv2d, depthwise as composed_depthwise, elu as composed_elu,
    gelu as composed_gelu, local_correlation as composed_local_correlation,
    max_pool_3x3_stride_2 as composed_max_pool_3x3_stride_2,
    photometric_error as composed_photometric_error, project as composed_project,
    running_statistics as composed_running_statistics, sigmoid as composed_sigmoid,
    smoothness as composed_smoothness, upsample_concat as composed_upsample_concat,
    warp as composed_warp,
};
pub use deepfusion_kernels::Precision;
pub use kernel::ConvOptions;

/// Whether a device is the CPU, on which the kernels of `deepfusion-kernels` run.
#[must_use]
pub fn is_cpu(device: &Device) -> bool {
    matches!(
        device.clone().inner().as_dispatch(),
        DispatchDevice::Flex(_)
    )
}

/// Whether the CPU's kernels run for this tensor, in single precision.
#[must_use]
pub fn has_kernels<const D: usize>(tensor: &Tensor<D>) -> bool {
    is_cpu(&tensor.device()) && tensor.dtype() == DType::F32
}

/// Whether a device is a GPU with kernels.
pub(crate) fn is_gpu(device: &Device) -> bool {
    #[cfg(feature = "gpu")]
    return matches!(
        device.clone().inner().as_dispatch(),
        DispatchDevice::Cube(_)
    );
    #[cfg(not(feature = "gpu"))]
    {
        let _ = device;
        false
    }
}

/// Whether the kernels for GPUs run for this tensor.
#[cfg(feature = "gpu")]
fn on_gpu<const D: usize>(tensor: &Tensor<D>) -> bool {
    is_gpu(&tensor.device()) && tensor.dtype() == DType::F32
}

/// Whether there are kernels for this tensor: on the CPU or, with the feature `gpu`, on a GPU, in single precision.
fn runs_kernels<const D: usize>(tensor: &Tensor<D>) -> bool {
    #[cfg(feature = "gpu")]
    if on_gpu(tensor) {
        return true;
    }
    has_kernels(tensor)
}

/// Convolution, y = w ⋆ x + b.
///
/// # Shapes
/// - `x`: `[N, C, H, W]`
/// - `weight`: `[O, C, kh, kw]`
/// - `bias`: `[O]`
/// - output: `[N, O, H', W']`, H' = ⌊(H + 2·padding − dilation·(kh − 1) − 1) / stride⌋ + 1
///
/// # Panics
/// When the shapes do not fit each other, as with Burn's own operations, or when an image is too small for its mirrored padding.
#[must_use]
pub fn conv2d(
    x: Tensor<4>,
    weight: Tensor<4>,
    bias: Option<Tensor<1>>,
    options: ConvOptions,
) -> Tensor<4> {
    if !runs_kernels(&x) {
        return composed::conv2d(x, weight, bias, options);
    }
    let [_, channels, _, _] = x.dims();
    let [out, expected, _, _] = weight.dims();
    assert_eq!(channels, expected, "the input's channels are the weight's");
    let has_bias = bias.is_some();
    // Without a bias any tensor: the kernel does not read it.
    let bias = bias.unwrap_or_else(|| Tensor::empty([out], &x.device().inner()));
    let (output, _) = <Dispatch as KernelOps>::kernel_conv2d(
        x.into_dispatch(),
        weight.into_dispatch(),
        bias.into_dispatch(),
        has_bias,
        autocast::within(options),
    );
    Tensor::from_dispatch(output)
}

/// The output of [`batch_norm`].
#[derive(Debug, Clone)]
pub struct BatchNormOutput {
    /// The normalised values, `[N, C, H, W]`.
    pub output: Tensor<4>,
    /// The batch's mean, `[C]`, without gradient.
    pub mean: Tensor<1>,
    /// The batch's variance without Bessel's correction, `[C]`, without gradient.
    pub variance: Tensor<1>,
}

/// Batch normalisation with the batch's own statistics, y = γ·(x − μ)/√(σ² + ε) + β, followed by a
/// ReLU with `relu`.
///
/// # Shapes
/// - `x`, output: `[N, C, H, W]`
/// - `gamma`, `beta`: `[C]`
#[must_use]
pub fn batch_norm(
    x: Tensor<4>,
    gamma: Tensor<1>,
    beta: Tensor<1>,
    epsilon: f64,
    relu: bool,
) -> BatchNormOutput {
    if !runs_kernels(&x) {
        return composed::batch_norm(x, gamma, beta, epsilon, relu);
    }
    let (output, mean, variance) = <Dispatch as KernelOps>::kernel_batch_norm(
        x.into_dispatch(),
        gamma.into_dispatch(),
        beta.into_dispatch(),
        epsilon,
        relu,
    );
    BatchNormOutput {
        output: Tensor::from_dispatch(output),
        mean: Tensor::from_dispatch(mean),
        variance: Tensor::from_dispatch(variance),
    }
}

/// Running statistics after a batch, (1 − m)·running + m·batch: mean and variance, without gradient. The batch's variance is multiplied by
/// `unbiased`, since [`BatchNormOutput::variance`] lacks Bessel's correction.
///
/// # Shapes
/// - all: `[C]`
#[must_use]
pub fn running_statistics(
    [mean, variance]: [Tensor<1>; 2],
    batch: [Tensor<1>; 2],
    momentum: f64,
    unbiased: f64,
) -> [Tensor<1>; 2] {
    let [batch_mean, batch_variance] = batch.map(Tensor::detach);
    if !runs_kernels(&mean) {
        let batch = [batch_mean, batch_variance];
        return composed::running_statistics([mean, variance], batch, momentum, unbiased);
    }
    let (mean, variance) = <Dispatch as KernelOps>::kernel_running_statistics(
        mean.into_dispatch(),
        variance.into_dispatch(),
        batch_mean.into_dispatch(),
        batch_variance.into_dispatch(),
        momentum,
        unbiased,
    );
    [mean, variance].map(Tensor::from_dispatch)
}

/// Depthwise convolution at stride 1 that keeps the size, with a border of zeros: every channel has a kernel of its own.
///
/// # Shapes
/// - `x`, output: `[N, C, H, W]`
/// - `weight`: `[C, 1, k, k]`, k odd
///
/// # Panics
/// When the shapes do not fit each other, as with Burn's own operations.
#[must_use]
pub fn depthwise(x: Tensor<4>, weight: Tensor<4>, dilation: usize) -> Tensor<4> {
    if !runs_kernels(&x) {
        return composed::depthwise(x, weight, dilation);
    }
    Tensor::from_dispatch(<Dispatch as KernelOps>::kernel_depthwise(
        x.into_dispatch(),
        weight.into_dispatch(),
        dilation,
    ))
}

/// GELU, x·Φ(x), Φ the normal distribution function.
#[must_use]
pub fn gelu(x: Tensor<4>) -> Tensor<4> {
    if !runs_kernels(&x) {
        return composed::gelu(x);
    }
    Tensor::from_dispatch(<Dispatch as KernelOps>::kernel_gelu(x.into_dispatch()))
}

/// ELU: x for x > 0, else eˣ − 1.
#[must_use]
pub fn elu(x: Tensor<4>) -> Tensor<4> {
    if !runs_kernels(&x) {
        return composed::elu(x);
    }
    Tensor::from_dispatch(<Dispatch as KernelOps>::kernel_elu(x.into_dispatch()))
}

/// max(a + b, 0): the end of a residual block.
///
/// # Shapes
/// - `a`, `b`, output: `[N, C, H, W]`
///
/// # Panics
/// When the shapes differ.
#[must_use]
pub fn add_relu(a: Tensor<4>, b: Tensor<4>) -> Tensor<4> {
    assert_eq!(a.dims(), b.dims(), "both have the same size");
    #[cfg(feature = "gpu")]
    if on_gpu(&a) {
        return Tensor::from_dispatch(<Dispatch as gpu::pointwise::PointwiseOps>::kernel_add_relu(
            a.into_dispatch(),
            b.into_dispatch(),
        ));
    }
    composed::add_relu(a, b)
}

/// 1 / (1 + e⁻ˣ).
#[must_use]
pub fn sigmoid(x: Tensor<4>) -> Tensor<4> {
    #[cfg(feature = "gpu")]
    if on_gpu(&x) {
        return Tensor::from_dispatch(<Dispatch as gpu::pointwise::PointwiseOps>::kernel_sigmoid(
            x.into_dispatch(),
        ));
    }
    composed::sigmoid(x)
}

/// ResNet's 3×3 maximum at stride 2, padded by one. Of equal values the first one, row by row, gets the gradient.
///
/// # Shapes
/// - `x`: `[N, C, H, W]`
/// - output: `[N, C, ⌈H / 2⌉, ⌈W / 2⌉]`
#[must_use]
pub fn max_pool_3x3_stride_2(x: Tensor<4>) -> Tensor<4> {
    #[cfg(feature = "gpu")]
    if on_gpu(&x) {
        return Tensor::from_dispatch(<Dispatch as gpu::max_pool::MaxPoolOps>::kernel_max_pool(
            x.into_dispatch(),
        ));
    }
    composed::max_pool_3x3_stride_2(x)
}

/// Bilinear enlargement with half-pixel centres on a GPU, in one pass; `None` elsewhere.
///
/// # Shapes
/// - `x`: `[N, C, h, w]`
/// - output: `[N, C, H, W]`, no side less than the input's
#[must_use]
pub(crate) fn enlarged_on_gpu(x: &Tensor<4>, size: [usize; 2]) -> Option<Tensor<4>> {
    #[cfg(feature = "gpu")]
    if on_gpu(x) {
        return Some(Tensor::from_dispatch(
            <Dispatch as gpu::enlarge::EnlargeOps>::kernel_enlarge(
                x.clone().into_dispatch(),
                size[0],
                size[1],
            ),
        ));
    }
    let _ = (x, size);
    None
}

/// Every pixel is repeated twice in both directions, and the skip feature appended.
///
/// # Shapes
/// - `x`: `[N, C, H, W]`
/// - `skip`: `[N, S, 2H, 2W]`
/// - output: `[N, C + S, 2H, 2W]`
#[must_use]
pub fn upsample_concat(x: Tensor<4>, skip: Option<Tensor<4>>) -> Tensor<4> {
    if !runs_kernels(&x) {
        return composed::upsample_concat(x, skip);
    }
    let [batch, _, height, width] = x.dims();
    let skip = skip
        .unwrap_or_else(|| Tensor::zeros([batch, 0, 2 * height, 2 * width], &x.device().inner()));
    assert_eq!(
        [skip.dims()[0], skip.dims()[2], skip.dims()[3]],
        [batch, 2 * height, 2 * width],
        "the skip feature is twice the size"
    );
    Tensor::from_dispatch(<Dispatch as KernelOps>::kernel_upsample_concat(
        x.into_dispatch(),
        skip.into_dispatch(),
    ))
}

/// The bilinear warp, out(p) = image⟨coords(p)⟩; outside the image its border is read.
///
/// # Shapes
/// - `image`: `[N, C, H, W]`
/// - `coords`: `[N, 2, H', W']`, u and v in pixels, integers at pixel centres
/// - output: `[N, C, H', W']`
#[must_use]
pub fn warp(image: Tensor<4>, coords: Tensor<4>) -> Tensor<4> {
    if !runs_kernels(&coords) {
        return composed::warp(image, coords);
    }
    assert_eq!(
        coords.dims()[..2],
        [image.dims()[0], 2],
        "two coordinates per pixel"
    );
    Tensor::from_dispatch(<Dispatch as KernelOps>::kernel_warp(
        image.into_dispatch(),
        coords.into_dispatch(),
    ))
}

/// The end points of a flow, p + f(p): the coordinates at which [`warp`] reads the second image.
///
/// # Shapes
/// - `flow`: `[N, 2, H, W]`, u and v in pixels
/// - output: `[N, 2, H, W]`, u and v in pixels
#[must_use]
pub fn flow_coords(flow: Tensor<4>) -> Tensor<4> {
    let [_, _, height, width] = flow.dims();
    let pixels = (0..height).flat_map(|y| (0..width).map(move |x| (x as f32, y as f32)));
    let (mut grid, rows): (Vec<f32>, Vec<f32>) = pixels.unzip();
    grid.extend(rows);
    let grid = TensorData::new(grid, [1, 2, height, width]);
    let device = flow.device();
    flow.add(Tensor::from_data(grid, &device))
}

/// Local correlation: the similarity of each pixel's feature to those around the same pixel of another image. out(d, p) = (1/C) Σ_c
/// first(c, p)·second(c, p + d) for every displacement d of at most `radius` pixels along each axis. Outside its image `second` is zero.
/// Displacement d is channel (d_y + radius)·(2·radius + 1) + (d_x + radius).
///
/// # Shapes
/// - `first`, `second`: `[N, C, H, W]`
/// - output: `[N, (2·radius + 1)², H, W]`
#[must_use]
pub fn local_correlation(first: Tensor<4>, second: Tensor<4>, radius: usize) -> Tensor<4> {
    assert_eq!(
        first.dims(),
        second.dims(),
        "both images have the same size"
    );
    if !runs_kernels(&first) {
        return composed::local_correlation(first, second, radius);
    }
    Tensor::from_dispatch(<Dispatch as KernelOps>::kernel_local_correlation(
        first.into_dispatch(),
        second.into_dispatch(),
        radius,
    ))
}

/// The pixel coordinates of one view's points in another view (the paper's Eq. 3–5): p' ~ H·p̃ + d·s, d the disparity. Points behind the
/// other camera get coordinates far outside its image.
///
/// # Shapes
/// - `disparity`: `[N, 1, H, W]`, 1/m
/// - `homography`: `[N, 3, 3]`, K·R·K⁻¹
/// - `shift`: `[N, 3]`, K·t
/// - output: `[N, 2, H, W]`, u and v in pixels
#[must_use]
pub fn project(disparity: Tensor<4>, homography: Tensor<3>, shift: Tensor<2>) -> Tensor<4> {
    if !runs_kernels(&disparity) {
        return composed::project(disparity, homography, shift);
    }
    Tensor::from_dispatch(<Dispatch as KernelOps>::kernel_project(
        disparity.into_dispatch(),
        homography.into_dispatch(),
        shift.into_dispatch(),
    ))
}

/// Where coordinates lie inside an image of `[height, width]`, its border included. No gradient.
///
/// # Shapes
/// - `coords`: `[N, 2, H, W]`
/// - output: `[N, 1, H, W]`
#[must_use]
pub fn in_view(coords: Tensor<4>, [height, width]: [usize; 2]) -> Tensor<4, Bool> {
    let coords = coords.detach();
    if !runs_kernels(&coords) {
        return composed::in_view(coords, [height, width]);
    }
    let inside = <Dispatch as KernelOps>::kernel_in_view(coords.into_dispatch(), height, width);
    Tensor::<4>::from_dispatch(inside).greater_elem(0.5)
}

/// Edge-aware smoothness (the paper's Eq. 8): mean(|∂ₓd*|·e^(−|∂ₓI|)) + mean(|∂ᵧd*|·e^(−|∂ᵧI|)), d* = disparity
/// over its mean in the image, |∂I| averaged over channels.
///
/// # Shapes
/// - `disparity`: `[N, 1, H, W]`
/// - `image`: `[N, C, H, W]`, without gradient
/// - output: one value
#[must_use]
pub fn smoothness(disparity: Tensor<4>, image: Tensor<4>) -> Tensor<1> {
    let image = image.detach();
    if !runs_kernels(&disparity) {
        return composed::smoothness(disparity, image);
    }
    Tensor::from_dispatch(<Dispatch as KernelOps>::kernel_smoothness(
        disparity.into_dispatch(),
        image.into_dispatch(),
    ))
}

/// The photometric error (the paper's Eq. 6): pe(a, b) = α·clamp((1 − SSIM(a, b))/2, 0, 1) + (1 −
/// α)·|a − b|, mean over channels. Only `a` has a gradient: `b` is the observation.
///
/// # Shapes
/// - `a`, `b`: `[N, C, H, W]`
/// - output: `[N, 1, H, W]`
#[must_use]
pub fn photometric_error(a: Tensor<4>, b: Tensor<4>, alpha: f64) -> Tensor<4> {
    assert_eq!(a.dims(), b.dims(), "both images have the same size");
    if !runs_kernels(&a) {
        return composed::photometric_error(a, b, alpha);
    }
    Tensor::from_dispatch(<Dispatch as KernelOps>::kernel_photometric(
        a.into_dispatch(),
        b.detach().into_dispatch(),
        alpha,
    ))
}

/// Adam's step of one parameter, as [`deepfusion_kernels::adam`], on the parameter's device. Returns its values and both moments after the
/// step. `factors` take precedence over the same numbers in `step`. If the step is not made, all three stay the same, whatever the gradient
/// is.
///
/// # Shapes
/// - all: `[count]`, without autodiff
#[must_use]
pub fn adam(
    step: &AdamStep,
    factors: &AdamFactors,
    values: Tensor<1>,
    gradient: Tensor<1>,
    [first, second]: [Tensor<1>; 2],
) -> (Tensor<1>, [Tensor<1>; 2]) {
    #[cfg(feature = "gpu")]
    if on_gpu(&values) {
        let (values, first, second) = <Dispatch as gpu::adam::AdamOps>::kernel_adam(
            values.into_dispatch(),
            gradient.into_dispatch(),
            first.into_dispatch(),
            second.into_dispatch(),
            factors.together().into_dispatch(),
            *step,
        );
        let moments = [first, second].map(Tensor::from_dispatch);
        return (Tensor::from_dispatch(values), moments);
    }
    composed::adam(step, factors, values, gradient, [first, second])
}

/// The sum of the squares of all values of flat tensors on one device, without autodiff: one value on that device.
///
/// # Panics
/// Without any tensor.
#[must_use]
pub fn sum_of_squares(tensors: &[Tensor<1>]) -> Tensor<1> {
    #[cfg(feature = "gpu")]
    if on_gpu(&tensors[0]) {
        return gpu::adam::sum_of_squares(tensors);
    }
    let squares = tensors.iter().map(|t| (t.clone() * t.clone()).sum());
    Tensor::cat(squares.collect(), 0).sum()
}
