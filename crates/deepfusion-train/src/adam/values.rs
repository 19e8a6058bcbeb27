//! Values that belong to a parameter, in main memory or on a device.

use burn::tensor::Tensor;
use deepfusion_kernels::AdamStep;
use deepfusion_nn::ops::{self, AdamFactors};

/// A parameter's gradient or one of its moments, flat.
#[derive(Debug, Clone)]
#[expect(
    clippy::large_enum_variant,
    reason = "there are a few hundred of them, and their values are a thousand times as large"
)]
pub(super) enum Values {
    /// In main memory: the processor's kernels read it there.
    Host(Vec<f32>),
    /// As a tensor: on a GPU, where it stays, or not in single precision.
    Device(Tensor<1>),
}

impl Values {
    pub(super) fn len(&self) -> usize {
        match self {
            Self::Host(values) => values.len(),
            Self::Device(values) => values.dims()[0],
        }
    }

    /// Zeros of the same number, on the same device.
    pub(super) fn zeros(&self) -> Self {
        match self {
            Self::Host(values) => Self::Host(vec![0.0; values.len()]),
            Self::Device(values) => Self::Device(values.zeros_like()),
        }
    }

    pub(super) fn to_vec(&self) -> Vec<f32> {
        match self {
            Self::Host(values) => values.clone(),
            Self::Device(values) => to_vec(values.clone()),
        }
    }

    /// Adds other values of the same parameter.
    pub(super) fn add(&mut self, others: Self) {
        match (&mut *self, others) {
            (Self::Host(sum), Self::Host(add)) => {
                for (sum, add) in sum.iter_mut().zip(add) {
                    *sum += add;
                }
            }
            (sum, Self::Device(add)) => *self = Self::Device(sum.beside(&add) + add),
            (Self::Device(sum), add @ Self::Host(_)) => {
                let add = add.beside(sum);
                *sum = sum.clone() + add;
            }
        }
    }

    /// The values on the gradient's device: after loading a checkpoint they are in main memory.
    pub(super) fn beside(&self, gradient: &Tensor<1>) -> Tensor<1> {
        match self {
            Self::Host(values) => Tensor::from_data(values.as_slice(), &gradient.device()),
            Self::Device(values) => values.clone(),
        }
    }

    /// Moves the values out into main memory.
    pub(super) fn take(&mut self) -> Vec<f32> {
        match std::mem::replace(self, Self::Host(Vec::new())) {
            Self::Host(values) => values,
            Self::Device(values) => to_vec(values),
        }
    }
}

/// [`deepfusion_kernels::adam`] of one parameter as tensor operations. Returns the parameter, which requires its gradient again, and its
/// moments. All of them stay on the GPU.
pub(super) fn update_on_device<const D: usize>(
    step: &AdamStep,
    factors: &AdamFactors,
    parameter: Tensor<D>,
    (gradient, moments): (Tensor<1>, [Tensor<1>; 2]),
) -> (Tensor<D>, [Tensor<1>; 2]) {
    let shape = parameter.dims();
    let values = parameter.inner().reshape([gradient.dims()[0]]);
    let (moved, moments) = ops::adam(step, factors, values, gradient, moments);
    (moved.reshape(shape).autodiff().require_grad(), moments)
}

#[expect(clippy::expect_used, reason = "it was converted")]
pub(super) fn to_vec<const D: usize>(tensor: Tensor<D>) -> Vec<f32> {
    let data = tensor.into_data().convert::<f32>();
    data.try_into_vec().expect("single precision")
}
