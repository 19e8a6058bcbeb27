//! Random graphs and images, and the difference of results.

use super::oracle::Image;
use crate::{Activation, Border, Conv, Graph, Op, ValueId};

/// Pseudo-random numbers in [−1, 1).
pub(super) fn noise(seed: u64) -> impl FnMut() -> f32 {
    let mut state = seed.wrapping_mul(0x9e37_79b9_7f4a_7c15) | 1;
    move || {
        state ^= state << 13;
        state ^= state >> 7;
        state ^= state << 17;
        (state >> 40) as f32 / (1_u64 << 23) as f32 - 1.0
    }
}

/// A graph under construction, with random weights.
pub(super) struct Builder<F> {
    pub(super) graph: Graph,
    pub(super) noise: F,
}

impl<F: FnMut() -> f32> Builder<F> {
    /// A 3×3 convolution with ReLU, modified by `change`.
    pub(super) fn conv(
        &mut self,
        input: ValueId,
        channels: usize,
        change: impl Fn(&mut Conv),
    ) -> ValueId {
        let mut conv = Conv {
            input,
            weight: Vec::new(),
            bias: Vec::new(),
            channels_in: self.graph.shape(input).channels,
            channels_out: channels,
            kernel: 3,
            stride: 1,
            dilation: 1,
            border: Border::Zero,
            residual: None,
            activation: Activation::Relu,
        };
        change(&mut conv);
        let taps = conv.channels_in * conv.kernel * conv.kernel;
        let scale = (3.0 / taps as f32).sqrt();
        conv.weight = (0..channels * taps)
            .map(|_| (self.noise)() * scale)
            .collect();
        conv.bias = (0..channels).map(|_| (self.noise)() * 0.3).collect();
        self.push(Op::Conv(Box::new(conv)))
    }

    pub(super) fn push(&mut self, op: Op) -> ValueId {
        let name = format!("node{}", self.graph.nodes().len());
        self.graph.push(name, op).unwrap()
    }
}

/// The largest absolute difference.
pub(super) fn deviation(engine: &[f32], exact: &Image) -> f64 {
    let off = engine.iter().zip(&exact.data);
    off.map(|(a, b)| (f64::from(*a) - b).abs())
        .fold(0.0, f64::max)
}

/// An image of noise in [0, 1).
pub(super) fn noise_image(seed: u64, width: usize, height: usize) -> Vec<f32> {
    let mut next = noise(seed);
    let values = (0..3 * width * height).map(|_| (next() + 1.0) / 2.0);
    values.collect()
}
