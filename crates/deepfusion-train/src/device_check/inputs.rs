//! Inputs that are the same on every device.

use burn::tensor::{Device, Gradients, Tensor, TensorData};

/// What an operation computes, in parts. Each part is compared relative to its own largest value.
pub(super) struct Outcome {
    pub(super) forward: Vec<Vec<f32>>,
    /// Gradients of its inputs; empty for an operation without gradients.
    pub(super) backward: Vec<Vec<f32>>,
}

/// Creates an operation's inputs on a device.
pub(super) struct Inputs {
    pub(super) device: Device,
    /// Relative error of every number, up or down, as if an earlier result had been rounded.
    pub(super) rounding: f32,
}

impl Inputs {
    /// Inputs without rounding errors.
    pub(super) fn exact(device: &Device) -> Self {
        Self {
            device: device.clone().autodiff(),
            rounding: 0.0,
        }
    }

    /// Pseudo-random numbers between two limits that depend on `seed` alone, as a tensor with a gradient.
    pub(super) fn noise<const D: usize>(
        &self,
        shape: [usize; D],
        seed: u32,
        ends: (f32, f32),
    ) -> Tensor<D> {
        self.fixed(shape, seed, ends).require_grad()
    }

    /// As [`Self::noise`], as a tensor without a gradient.
    pub(super) fn fixed<const D: usize>(
        &self,
        shape: [usize; D],
        seed: u32,
        ends: (f32, f32),
    ) -> Tensor<D> {
        let mut values = uniform(shape.iter().product(), seed, ends);
        if self.rounding > 0.0 {
            let off = uniform(values.len(), seed + 1000, (-self.rounding, self.rounding));
            values
                .iter_mut()
                .zip(off)
                .for_each(|(v, off)| *v += *v * off);
        }
        Tensor::from_data(TensorData::new(values, shape), &self.device)
    }
}

/// Marsaglia's xorshift.
fn uniform(count: usize, seed: u32, (low, high): (f32, f32)) -> Vec<f32> {
    let mut state = seed.wrapping_mul(0x9e37_79b9) | 1;
    let mut next = || {
        state ^= state << 13;
        state ^= state >> 17;
        state ^= state << 5;
        state as f32 / u32::MAX as f32
    };
    (0..count).map(|_| low + (high - low) * next()).collect()
}

/// A tensor's values in main memory.
pub(super) fn values<const D: usize>(tensor: Tensor<D>) -> Vec<f32> {
    tensor.into_data().iter::<f32>().collect()
}

/// An input's gradient.
pub(super) fn gradient<const D: usize>(input: &Tensor<D>, raw: &Gradients) -> Vec<f32> {
    input.grad(raw).map(values).unwrap_or_default()
}

/// A result, and the gradients of a weighted sum of its values. In a plain sum, errors could cancel out.
pub(super) fn outcome<const D: usize>(
    result: Tensor<D>,
    gradients: impl FnOnce(&Gradients) -> Vec<Vec<f32>>,
) -> Outcome {
    let shape = result.dims();
    let weights = uniform(shape.iter().product(), 99, (-1.0, 1.0));
    let weights = Tensor::from_data(TensorData::new(weights, shape), &result.device());
    let raw = (result.clone() * weights).sum().backward();
    Outcome {
        forward: vec![values(result)],
        backward: gradients(&raw),
    }
}
