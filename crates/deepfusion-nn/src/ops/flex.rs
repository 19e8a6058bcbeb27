//! The operations on the CPU: Burn's Flex tensors are passed to the kernels as slices.

mod backward;

use super::kernel::{ConvOptions, KernelOps};
use burn::backend::{Flex, TensorMetadata, ops::FloatTensorOps, tensor::FloatTensor};
use burn::tensor::TensorData;
use deepfusion_kernels::{
    self as kernels, ConvShape, CorrelationShape, DepthwiseShape, PhotometricShape,
    SmoothnessShape, WarpShape,
};
use std::mem::MaybeUninit;

type Float = FloatTensor<Flex>;

/// A tensor's values in order, copied only if the tensor is a view.
struct Values(Float);

impl Values {
    fn of(tensor: Float) -> Self {
        Self(tensor.to_contiguous())
    }

    #[expect(
        clippy::expect_used,
        reason = "made contiguous, and of the networks' type"
    )]
    fn slice(&self) -> &[f32] {
        self.0
            .as_slice::<f32>()
            .expect("a contiguous tensor of f32: the networks are built in single precision")
    }
}

fn dims<const D: usize>(tensor: &Float) -> [usize; D] {
    tensor.shape().dims()
}

/// Zeroed memory for an operation's result: for small results, and for kernels that need it cleared.
fn zeros(sizes: &[usize]) -> Vec<f32> {
    vec![0.0; count(sizes)]
}

/// An operation's result in uninitialised memory that `write` fills. For large results: clearing them first took a
/// fourteenth of a training step.
///
/// # Safety
/// `write` must write every value of the memory that it is given.
unsafe fn written<R>(
    len: usize,
    write: impl FnOnce(&mut [MaybeUninit<f32>]) -> R,
) -> (Vec<f32>, R) {
    let mut values = Vec::with_capacity(len);
    let result = write(&mut values.spare_capacity_mut()[..len]);
    // SAFETY: the capacity suffices, and `write` has written all values (the caller's promise).
    unsafe { values.set_len(len) };
    (values, result)
}

/// The number of values of a tensor of these sizes.
#[expect(clippy::expect_used, reason = "the size of a tensor in memory")]
fn count(sizes: &[usize]) -> usize {
    let all = sizes.iter().try_fold(1_usize, |all, n| all.checked_mul(*n));
    all.expect("sizes of a tensor, which is in memory or as large as one that is")
}

fn tensor<const D: usize>(values: Vec<f32>, shape: [usize; D]) -> Float {
    Flex::float_from_data(TensorData::new(values, shape), &Default::default())
}

fn conv_shape(x: [usize; 4], weight: [usize; 4], options: ConvOptions) -> ConvShape {
    ConvShape {
        batch: x[0],
        in_channels: x[1],
        in_height: x[2],
        in_width: x[3],
        out_channels: weight[0],
        kernel_height: weight[2],
        kernel_width: weight[3],
        stride: options.stride,
        padding: options.padding,
        dilation: options.dilation,
        reflect: options.reflect,
        precision: options.precision,
    }
}

fn depthwise_shape(x: [usize; 4], kernel: usize, dilation: usize) -> DepthwiseShape {
    DepthwiseShape {
        channels: x[1],
        height: x[2],
        width: x[3],
        kernel,
        dilation,
    }
}

fn warp_shape(image: &Float, coords: &Float) -> ([usize; 4], WarpShape) {
    let [batch, channels, in_height, in_width] = dims(image);
    let [_, _, out_height, out_width] = dims(coords);
    (
        [batch, channels, out_height, out_width],
        WarpShape {
            channels,
            in_height,
            in_width,
            out_area: out_height * out_width,
        },
    )
}

/// The shape of a correlation of N×C×H×W images.
fn correlation_shape(sizes: [usize; 4], radius: usize) -> CorrelationShape {
    let [_, channels, height, width] = sizes;
    CorrelationShape {
        channels,
        height,
        width,
        radius,
    }
}

fn photometric_shape(a: &Float, alpha: f64) -> ([usize; 4], PhotometricShape) {
    let [batch, channels, height, width] = dims(a);
    (
        [batch, channels, height, width],
        PhotometricShape {
            channels,
            height,
            width,
            alpha,
        },
    )
}

fn smoothness_shape(image: &Float) -> SmoothnessShape {
    let [batch, channels, height, width] = dims(image);
    SmoothnessShape {
        batch,
        channels,
        height,
        width,
    }
}

fn single(value: f64) -> f32 {
    value as f32
}

impl KernelOps for Flex {
    fn kernel_depthwise(x: Float, weight: Float, dilation: usize) -> Float {
        let sizes: [usize; 4] = dims(&x);
        let [_, _, kernel, _] = dims(&weight);
        let shape = depthwise_shape(sizes, kernel, dilation);
        let (x, weight) = (Values::of(x), Values::of(weight));
        let mut out = zeros(&sizes);
        kernels::depthwise(&shape, x.slice(), weight.slice(), &mut out);
        tensor(out, sizes)
    }

    fn kernel_gelu(x: Float) -> Float {
        let sizes: [usize; 4] = dims(&x);
        let x = Values::of(x);
        // SAFETY: a kernel that takes a `Slot` writes every value.
        let (out, ()) = unsafe { written(x.slice().len(), |out| kernels::gelu(x.slice(), out)) };
        tensor(out, sizes)
    }

    fn kernel_upsample_concat(x: Float, skip: Float) -> Float {
        let [batch, channels, height, width] = dims(&x);
        let [_, skips, _, _] = dims(&skip);
        let (x, skip) = (Values::of(x), Values::of(skip));
        let sizes = [batch, channels + skips, 2 * height, 2 * width];
        // SAFETY: a kernel that takes a `Slot` writes every value.
        let (out, ()) = unsafe {
            written(count(&sizes), |out| {
                kernels::upsample_concat(x.slice(), skip.slice(), batch, channels, width, out);
            })
        };
        tensor(out, sizes)
    }

    fn kernel_conv2d(
        x: Float,
        weight: Float,
        bias: Float,
        has_bias: bool,
        options: ConvOptions,
    ) -> (Float, Float) {
        let shape = conv_shape(dims(&x), dims(&weight), options);
        let kept = x.clone();
        let (x, weight, bias) = (Values::of(x), Values::of(weight), Values::of(bias));
        let bias = has_bias.then(|| bias.slice());
        // SAFETY: a kernel that takes a `Slot` writes every value.
        let (out, ()) = unsafe {
            written(shape.out_len(), |out| {
                kernels::conv2d(&shape, x.slice(), weight.slice(), bias, out);
            })
        };
        let sizes = [
            shape.batch,
            shape.out_channels,
            shape.out_height(),
            shape.out_width(),
        ];
        (tensor(out, sizes), kept)
    }

    fn kernel_batch_norm(
        x: Float,
        gamma: Float,
        beta: Float,
        epsilon: f64,
        relu: bool,
    ) -> (Float, Float, Float) {
        let sizes: [usize; 4] = dims(&x);
        let (x, gamma, beta) = (Values::of(x), Values::of(gamma), Values::of(beta));
        // SAFETY: a kernel that takes a `Slot` writes every value.
        let (out, saved) = unsafe {
            written(x.slice().len(), |out| {
                kernels::batch_norm(
                    x.slice(),
                    gamma.slice(),
                    beta.slice(),
                    sizes[2] * sizes[3],
                    single(epsilon),
                    relu,
                    out,
                )
            })
        };
        let channels = [sizes[1]];
        (
            tensor(out, sizes),
            tensor(saved.mean, channels),
            tensor(saved.variance, channels),
        )
    }

    fn kernel_running_statistics(
        mean: Float,
        variance: Float,
        batch_mean: Float,
        batch_variance: Float,
        momentum: f64,
        unbiased: f64,
    ) -> (Float, Float) {
        let towards = |running: Float, batch: Float, scale: f32| {
            let channels: [usize; 1] = dims(&running);
            let (running, batch) = (Values::of(running), Values::of(batch));
            let (kept, added) = (single(1.0 - momentum), single(momentum));
            let both = running.slice().iter().zip(batch.slice());
            let values = both.map(|(old, new)| old * kept + new * scale * added);
            tensor(values.collect(), channels)
        };
        (
            towards(mean, batch_mean, 1.0),
            towards(variance, batch_variance, single(unbiased)),
        )
    }

    fn kernel_elu(x: Float) -> Float {
        let sizes: [usize; 4] = dims(&x);
        let x = Values::of(x);
        // SAFETY: a kernel that takes a `Slot` writes every value.
        let (out, ()) = unsafe { written(x.slice().len(), |out| kernels::elu(x.slice(), out)) };
        tensor(out, sizes)
    }

    fn kernel_warp(image: Float, coords: Float) -> Float {
        let (sizes, shape) = warp_shape(&image, &coords);
        let (image, coords) = (Values::of(image), Values::of(coords));
        let mut out = zeros(&sizes);
        kernels::warp(&shape, image.slice(), coords.slice(), &mut out);
        tensor(out, sizes)
    }

    fn kernel_local_correlation(first: Float, second: Float, radius: usize) -> Float {
        let sizes: [usize; 4] = dims(&first);
        let shape = correlation_shape(sizes, radius);
        let (first, second) = (Values::of(first), Values::of(second));
        let sizes = [sizes[0], shape.displacements(), sizes[2], sizes[3]];
        let mut out = zeros(&sizes);
        kernels::local_correlation(&shape, first.slice(), second.slice(), &mut out);
        tensor(out, sizes)
    }

    fn kernel_project(disparity: Float, homography: Float, shift: Float) -> Float {
        let [batch, _, height, width] = dims(&disparity);
        let (depth, homography) = (Values::of(disparity), Values::of(homography));
        let shift = Values::of(shift);
        let mut out = zeros(&[2, batch, height, width]);
        kernels::project(
            (height, width),
            depth.slice(),
            homography.slice(),
            shift.slice(),
            &mut out,
        );
        tensor(out, [batch, 2, height, width])
    }

    fn kernel_in_view(coords: Float, height: usize, width: usize) -> Float {
        let [batch, _, out_height, out_width] = dims(&coords);
        let coords = Values::of(coords);
        let area = out_height * out_width;
        let mut out = zeros(&[batch, area]);
        kernels::in_view((height, width), coords.slice(), area, &mut out);
        tensor(out, [batch, 1, out_height, out_width])
    }

    fn kernel_smoothness(disparity: Float, image: Float) -> Float {
        let shape = smoothness_shape(&image);
        let (disparity, image) = (Values::of(disparity), Values::of(image));
        let loss = kernels::smoothness(&shape, disparity.slice(), image.slice());
        tensor(vec![loss], [1])
    }

    fn kernel_photometric(a: Float, b: Float, alpha: f64) -> Float {
        let ([batch, _, height, width], shape) = photometric_shape(&a, alpha);
        let (a, b) = (Values::of(a), Values::of(b));
        let mut out = zeros(&[batch, height, width]);
        kernels::photometric_error(&shape, a.slice(), b.slice(), &mut out);
        tensor(out, [batch, 1, height, width])
    }
}
