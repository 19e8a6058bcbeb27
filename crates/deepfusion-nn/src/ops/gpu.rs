//! The operations on a GPU as kernels of their own, in CubeCL's language: a few launches each, forward and backward, where Burn's
//! operations need dozens. They compute the same as `composed`.
//!
//! A kernel runs along the pixels of a plane, and a grid's second axis counts the planes. One group of threads computes a sum over a plane,
//! or over a channel of all images, in shared memory.

#![allow(
    clippy::too_many_arguments,
    reason = "a kernel's buffers and sizes are its arguments"
)]

pub(super) mod adam;
mod backward;
mod batch_norm;
pub(super) mod conv;
mod correlation;
mod depthwise;
mod elu;
pub(super) mod enlarge;
mod gelu;
mod grid;
pub(super) mod max_pool;
mod mirror;
mod photometric;
pub(super) mod pointwise;
mod project;
mod smoothness;
mod upsample;
mod warp;

use super::kernel::{ConvOptions, KernelOps};
use burn::backend::TensorMetadata;
use burn::tensor::{DType, Shape};
use burn_cubecl::CubeBackend;
use burn_cubecl::cubecl::prelude::*;
use burn_cubecl::kernel::into_contiguous;
use burn_cubecl::ops::numeric::empty_device_contiguous_dtype;
use burn_cubecl::tensor::CubeTensor;
use grid::{SUM_GROUPS, SUM_THREADS, along_pixels, summing, values};

fn dims<const D: usize>(tensor: &CubeTensor) -> [usize; D] {
    tensor.shape().dims()
}

/// A tensor as a kernel's input: its values in order, copied if the tensor is a view.
fn input(tensor: CubeTensor) -> BufferArg {
    into_contiguous(tensor).into_buffer_arg()
}

/// Memory for a result, on the device of a tensor.
fn room<const D: usize>(beside: &CubeTensor, shape: [usize; D]) -> CubeTensor {
    let (client, device) = (beside.client.clone(), beside.device.clone());
    empty_device_contiguous_dtype(client, device, Shape::from(shape), DType::F32)
}

/// A tensor as a kernel's output.
fn output(tensor: &CubeTensor) -> BufferArg {
    tensor.clone().into_buffer_arg()
}

impl KernelOps for CubeBackend {
    fn kernel_depthwise(x: CubeTensor, weight: CubeTensor, dilation: usize) -> CubeTensor {
        depthwise::forward(x, weight, dilation)
    }

    fn kernel_gelu(x: CubeTensor) -> CubeTensor {
        gelu::forward(x)
    }

    fn kernel_upsample_concat(x: CubeTensor, skip: CubeTensor) -> CubeTensor {
        upsample::forward(x, skip)
    }

    fn kernel_running_statistics(
        mean: CubeTensor,
        variance: CubeTensor,
        batch_mean: CubeTensor,
        batch_variance: CubeTensor,
        momentum: f64,
        unbiased: f64,
    ) -> (CubeTensor, CubeTensor) {
        let running = [mean, variance];
        let batch = [batch_mean, batch_variance];
        batch_norm::running(running, batch, momentum as f32, unbiased as f32)
    }

    fn kernel_conv2d(
        x: CubeTensor,
        weight: CubeTensor,
        bias: CubeTensor,
        has_bias: bool,
        options: ConvOptions,
    ) -> (CubeTensor, CubeTensor) {
        conv::forward(x, weight, has_bias.then_some(bias), options)
    }

    fn kernel_batch_norm(
        x: CubeTensor,
        gamma: CubeTensor,
        beta: CubeTensor,
        epsilon: f64,
        relu: bool,
    ) -> (CubeTensor, CubeTensor, CubeTensor) {
        batch_norm::forward(x, gamma, beta, epsilon as f32, relu)
    }

    fn kernel_elu(x: CubeTensor) -> CubeTensor {
        elu::forward(x)
    }

    fn kernel_warp(image: CubeTensor, coords: CubeTensor) -> CubeTensor {
        warp::forward(image, coords)
    }

    fn kernel_local_correlation(
        first: CubeTensor,
        second: CubeTensor,
        radius: usize,
    ) -> CubeTensor {
        correlation::forward(first, second, radius)
    }

    fn kernel_project(
        disparity: CubeTensor,
        homography: CubeTensor,
        shift: CubeTensor,
    ) -> CubeTensor {
        project::forward(disparity, homography, shift)
    }

    fn kernel_in_view(coords: CubeTensor, height: usize, width: usize) -> CubeTensor {
        project::in_view(coords, height, width)
    }

    fn kernel_smoothness(disparity: CubeTensor, image: CubeTensor) -> CubeTensor {
        smoothness::forward(disparity, image)
    }

    fn kernel_photometric(a: CubeTensor, b: CubeTensor, alpha: f64) -> CubeTensor {
        photometric::forward(a, b, alpha)
    }
}
