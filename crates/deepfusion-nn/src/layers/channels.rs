//! Layers that act on each pixel's channels alone.

use burn::module::{Module, Param};
use burn::tensor::{Device, Tensor, TensorData};

use super::{Conv2d, Conv2dConfig};
use crate::init::{WeightInit, WeightRng};
use crate::ops::gelu;

/// Layer normalisation over each pixel's channels, y = γ (x − μ) / √(σ² + ε) + β.
#[derive(Module, Debug)]
pub struct ChannelNorm {
    /// γ, `[channels]`.
    pub weight: Param<Tensor<1>>,
    /// β, `[channels]`.
    pub bias: Param<Tensor<1>>,
}

impl ChannelNorm {
    /// Added to the variance.
    pub const EPSILON: f64 = deepfusion_model::LAYER_NORM_EPSILON;

    /// A new layer: γ = 1, β = 0.
    #[must_use]
    pub fn new(channels: usize, device: &Device) -> Self {
        let all = |value: f32| {
            Param::from_data(TensorData::new(vec![value; channels], [channels]), device)
        };
        Self {
            weight: all(1.0),
            bias: all(0.0),
        }
    }

    /// # Shapes
    /// - `x`, output: `[batch, channels, height, width]`
    pub fn forward(&self, x: Tensor<4>) -> Tensor<4> {
        let channels = x.dims()[1];
        let per_channel = |t: &Param<Tensor<1>>| t.val().reshape([1, channels, 1, 1]);
        let centred = x.clone().sub(x.mean_dim(1));
        let variance = centred.clone().powi_scalar(2).mean_dim(1);
        let deviation = variance.add_scalar(Self::EPSILON).sqrt();
        centred
            .div(deviation)
            .mul(per_channel(&self.weight))
            .add(per_channel(&self.bias))
    }
}

/// Two 1×1 convolutions with a GELU between them: to more channels and back.
#[derive(Module, Debug)]
pub struct Bottleneck {
    /// W₁, to `expansion` times the channels.
    pub expand: Conv2d,
    /// W₂, back to the original channels.
    pub project: Conv2d,
}

impl Bottleneck {
    /// A new layer.
    #[must_use]
    pub fn new(channels: usize, expansion: usize, rng: &mut WeightRng, device: &Device) -> Self {
        let mut point = |from: usize, to: usize| {
            let mut conv = Conv2dConfig::new(from, to, 1);
            conv.init = WeightInit::KaimingNormalFanOut;
            conv.init(rng, device)
        };
        Self {
            expand: point(channels, expansion * channels),
            project: point(expansion * channels, channels),
        }
    }

    /// W₂·gelu(W₁·x + b₁) + b₂.
    ///
    /// # Shapes
    /// - `x`, output: `[batch, channels, height, width]`
    pub fn forward(&self, x: Tensor<4>) -> Tensor<4> {
        self.project.forward(gelu(self.expand.forward(x)))
    }
}

/// Factors of a residual branch's channels, all 1e-6: a new branch contributes almost nothing (layer scale; Touvron et al., arXiv
/// 2103.17239).
pub(crate) fn layer_scale(channels: usize, device: &Device) -> Param<Tensor<1>> {
    Param::from_data(
        TensorData::new(vec![1e-6_f32; channels], [channels]),
        device,
    )
}

/// Each channel times its factor.
pub(crate) fn scaled(x: Tensor<4>, scale: &Param<Tensor<1>>) -> Tensor<4> {
    let channels = x.dims()[1];
    x.mul(scale.val().reshape([1, channels, 1, 1]))
}
