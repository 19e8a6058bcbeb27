//! The same numbers on every device.

use burn::tensor::{Device, Gradients, Tensor, TensorData};

/// What an operation gives.
pub(super) struct Outcome {
    pub(super) forward: Vec<f32>,
    /// Gradients of its inputs, one after another; empty of an operation without.
    pub(super) backward: Vec<f32>,
}

/// [`fixed`], as a tensor that learns.
pub(super) fn noise<const D: usize>(
    shape: [usize; D],
    seed: u32,
    ends: (f32, f32),
    device: &Device,
) -> Tensor<D> {
    fixed(shape, seed, ends, device).require_grad()
}

/// Numbers between two ends, without a pattern, which depend on `seed` alone.
pub(super) fn fixed<const D: usize>(
    shape: [usize; D],
    seed: u32,
    (low, high): (f32, f32),
    device: &Device,
) -> Tensor<D> {
    // Marsaglia's xorshift.
    let mut state = seed.wrapping_mul(0x9e37_79b9) | 1;
    let mut next = || {
        state ^= state << 13;
        state ^= state >> 17;
        state ^= state << 5;
        state as f32 / u32::MAX as f32
    };
    let values = (0..shape.iter().product()).map(|_| low + (high - low) * next());
    let data = TensorData::new(values.collect::<Vec<f32>>(), shape);
    Tensor::from_data(data, device)
}

/// A tensor's values in main memory.
pub(super) fn values<const D: usize>(tensor: Tensor<D>) -> Vec<f32> {
    tensor.into_data().iter::<f32>().collect()
}

/// An input's gradient.
pub(super) fn gradient<const D: usize>(input: &Tensor<D>, raw: &Gradients) -> Vec<f32> {
    input.grad(raw).map(values).unwrap_or_default()
}

/// A result, and the gradients of its values' sum, each with a weight of its own: a sum alone would hide what cancels out.
pub(super) fn outcome<const D: usize>(
    result: Tensor<D>,
    gradients: impl FnOnce(&Gradients) -> Vec<Vec<f32>>,
) -> Outcome {
    let weights = fixed(result.dims(), 99, (-1.0, 1.0), &result.device());
    let raw = (result.clone() * weights).sum().backward();
    Outcome {
        forward: values(result),
        backward: gradients(&raw).concat(),
    }
}
