//! The same numbers on every device.

use burn::tensor::{Device, Gradients, Tensor, TensorData};

/// What an operation gives, in parts, each of which has a size of its own.
pub(super) struct Outcome {
    pub(super) forward: Vec<Vec<f32>>,
    /// Gradients of its inputs; empty of an operation without.
    pub(super) backward: Vec<Vec<f32>>,
}

/// Where an operation's inputs are made.
pub(super) struct Inputs {
    pub(super) device: Device,
    /// By which share of itself every number is off, up or down: as if something before had been rounded.
    pub(super) rounding: f32,
}

impl Inputs {
    /// As they are.
    pub(super) fn exact(device: &Device) -> Self {
        Self {
            device: device.clone().autodiff(),
            rounding: 0.0,
        }
    }

    /// Numbers between two ends, without a pattern, which depend on `seed` alone; a tensor that learns.
    pub(super) fn noise<const D: usize>(
        &self,
        shape: [usize; D],
        seed: u32,
        ends: (f32, f32),
    ) -> Tensor<D> {
        self.fixed(shape, seed, ends).require_grad()
    }

    /// The same of a tensor that does not learn.
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

/// A result, and the gradients of its values' sum, each with a weight of its own: a sum alone would hide what cancels out.
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
