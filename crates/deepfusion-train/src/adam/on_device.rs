//! The same step as tensor operations: parameters, gradients and moments stay on the GPU.

use burn::tensor::Tensor;
use deepfusion_kernels::AdamStep;
use deepfusion_nn::ops;

/// [`deepfusion_kernels::adam`] of one parameter, which comes back ready to learn again, with its moments.
pub(super) fn update<const D: usize>(
    step: &AdamStep,
    parameter: Tensor<D>,
    gradient: Tensor<1>,
    moments: [Tensor<1>; 2],
) -> (Tensor<D>, [Tensor<1>; 2]) {
    let shape = parameter.dims();
    let values = parameter.inner().reshape([gradient.dims()[0]]);
    let (moved, moments) = ops::adam(step, values, gradient, moments);
    (moved.reshape(shape).autodiff().require_grad(), moments)
}
