//! The backward passes on a GPU.

use super::super::kernel::{ConvOptions, KernelBackward};
use super::{
    batch_norm, conv, correlation, depthwise, elu, gelu, photometric, project, smoothness,
    upsample, warp,
};
use burn_cubecl::CubeBackend;
use burn_cubecl::tensor::CubeTensor;

impl KernelBackward for CubeBackend {
    fn depthwise_grad_x(weight: CubeTensor, grad: CubeTensor, dilation: usize) -> CubeTensor {
        depthwise::grad_input(weight, grad, dilation)
    }

    fn depthwise_grad_weight(
        x: CubeTensor,
        grad: CubeTensor,
        shape: [usize; 4],
        dilation: usize,
    ) -> CubeTensor {
        depthwise::grad_weight(x, grad, shape, dilation)
    }

    fn gelu_grad(x: CubeTensor, grad: CubeTensor) -> CubeTensor {
        gelu::backward(x, grad)
    }

    fn upsample_concat_grad(grad: CubeTensor, channels: usize) -> [CubeTensor; 2] {
        upsample::backward(grad, channels)
    }

    fn conv2d_grads(
        kept: CubeTensor,
        size: [usize; 4],
        weight: CubeTensor,
        grad: CubeTensor,
        options: ConvOptions,
        wanted: [bool; 2],
    ) -> [Option<CubeTensor>; 2] {
        conv::backward(kept, size, weight, grad, options, wanted)
    }

    fn conv2d_grad_bias(grad: CubeTensor) -> CubeTensor {
        conv::grad_bias(grad)
    }

    fn batch_norm_grad(
        x: CubeTensor,
        parameters: [CubeTensor; 2],
        statistics: [CubeTensor; 2],
        grad: CubeTensor,
        epsilon: f64,
        relu: bool,
    ) -> [CubeTensor; 3] {
        batch_norm::backward(x, parameters, statistics, grad, epsilon as f32, relu)
    }

    fn elu_grad(output: CubeTensor, grad: CubeTensor) -> CubeTensor {
        elu::backward(output, grad)
    }

    fn warp_grad_image(image: CubeTensor, coords: CubeTensor, grad: CubeTensor) -> CubeTensor {
        warp::grad_image(image, coords, grad)
    }

    fn warp_grad_coords(image: CubeTensor, coords: CubeTensor, grad: CubeTensor) -> CubeTensor {
        warp::grad_coords(image, coords, grad)
    }

    fn local_correlation_grad_first(
        second: CubeTensor,
        grad: CubeTensor,
        radius: usize,
    ) -> CubeTensor {
        correlation::backward(second, grad, radius, true)
    }

    fn local_correlation_grad_second(
        first: CubeTensor,
        grad: CubeTensor,
        radius: usize,
    ) -> CubeTensor {
        correlation::backward(first, grad, radius, false)
    }

    fn project_grad(
        disparity: CubeTensor,
        homography: CubeTensor,
        shift: CubeTensor,
        grad: CubeTensor,
    ) -> [CubeTensor; 3] {
        project::backward(disparity, homography, shift, grad)
    }

    fn smoothness_grad(disparity: CubeTensor, image: CubeTensor, grad: CubeTensor) -> CubeTensor {
        smoothness::backward(disparity, image, grad)
    }

    fn photometric_grad(a: CubeTensor, b: CubeTensor, grad: CubeTensor, alpha: f64) -> CubeTensor {
        photometric::backward(a, b, grad, alpha)
    }
}
