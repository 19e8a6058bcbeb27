//! The same step as tensor operations: parameters, gradients and moments stay on the GPU.

use burn::tensor::Tensor;
use deepfusion_kernels::AdamStep;

/// The sum of squares of all values: one number is read from the device, whatever their count.
pub(super) fn sum_of_squares(values: &[&Tensor<1>]) -> f64 {
    let squares = values.iter().map(|&v| (v.clone() * v.clone()).sum());
    let squares: Vec<_> = squares.collect();
    if squares.is_empty() {
        return 0.0;
    }
    let sum = Tensor::cat(squares, 0).sum();
    f64::from(sum.into_scalar::<f32>())
}

/// [`deepfusion_kernels::adam`] of one parameter, which comes back ready to learn again, with its moments.
pub(super) fn update<const D: usize>(
    step: &AdamStep,
    parameter: Tensor<D>,
    gradient: Tensor<1>,
    [first, second]: [Tensor<1>; 2],
) -> (Tensor<D>, [Tensor<1>; 2]) {
    let shape = parameter.dims();
    let values = parameter.inner().reshape([gradient.dims()[0]]);
    let gradient = gradient.mul_scalar(step.gradient_scale);
    let squared = gradient.clone() * gradient.clone();
    let first = first.mul_scalar(step.beta1) + gradient.mul_scalar(1.0 - step.beta1);
    let second = second.mul_scalar(step.beta2) + squared.mul_scalar(1.0 - step.beta2);
    let root = second.clone().div_scalar(step.correction2).sqrt();
    let direction = first.clone().div_scalar(step.correction1) / root.add_scalar(step.epsilon);
    let kept = values.mul_scalar(1.0 - step.learning_rate * step.weight_decay);
    let moved = kept - direction.mul_scalar(step.learning_rate);
    let moved = moved.reshape(shape).autodiff().require_grad();
    (moved, [first, second])
}
