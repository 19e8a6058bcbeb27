//! Cross-covariance attention (XCA; El-Nouby et al., arXiv 2106.09681): channels attend to channels, not pixels to pixels.

use burn::module::{Module, Param};
use burn::tensor::activation::softmax;
use burn::tensor::{Device, Tensor, TensorData};

use crate::init::{WeightInit, WeightRng};
use crate::layers::{Conv2d, Conv2dConfig};

/// Attention between the channels of a feature, in groups (heads).
#[derive(Module, Debug)]
pub struct CrossCovariance {
    /// 1×1 to queries, keys and values, in this order, with `channels` channels each; in each of them the channels of a head lie together.
    pub qkv: Conv2d,
    /// τ, the factor of the similarities of each head, `[heads]`.
    pub temperature: Param<Tensor<1>>,
    /// 1×1 over all heads.
    pub project: Conv2d,
}

impl CrossCovariance {
    /// Added to the squared length of a query or key, so that the length is at least 1e-12, as in PyTorch.
    pub const SQUARED_LENGTH_EPSILON: f64 = 1e-24;

    /// A new module for a feature of `channels` channels, a multiple of `heads`.
    #[must_use]
    pub fn new(channels: usize, heads: usize, rng: &mut WeightRng, device: &Device) -> Self {
        let mut point = |from: usize, to: usize| {
            let mut conv = Conv2dConfig::new(from, to, 1);
            conv.init = WeightInit::KaimingNormalFanOut;
            conv.init(rng, device)
        };
        Self {
            qkv: point(channels, 3 * channels),
            temperature: Param::from_data(TensorData::new(vec![1.0_f32; heads], [heads]), device),
            project: point(channels, channels),
        }
    }

    /// P·[softmax(τ·q̂·k̂ᵀ)·v] of each head, where q̂ and k̂ are queries and keys of length 1: rows are channels, columns pixels.
    ///
    /// # Shapes
    /// - `x`, output: `[batch, channels, height, width]`
    pub fn forward(&self, x: Tensor<4>) -> Tensor<4> {
        let [batch, channels, height, width] = x.dims();
        let [heads] = self.temperature.val().dims();
        let each = channels / heads;
        let qkv = self.qkv.forward(x);
        let part = |index: usize| {
            let part = qkv.clone().narrow(1, index * channels, channels);
            part.reshape([batch, heads, each, height * width])
        };
        let unit = |t: Tensor<4>| {
            let squares = t.clone().powi_scalar(2).sum_dim(3);
            t.div(squares.add_scalar(Self::SQUARED_LENGTH_EPSILON).sqrt())
        };
        let similarity = unit(part(0)).matmul(unit(part(1)).swap_dims(2, 3));
        let temperature = self.temperature.val().reshape([1, heads, 1, 1]);
        let attention = softmax(similarity.mul(temperature), 3);
        let mixed = attention.matmul(part(2));
        let mixed = mixed.reshape([batch, channels, height, width]);
        self.project.forward(mixed)
    }
}
