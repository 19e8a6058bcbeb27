use burn::module::{Module, Param};
use burn::tensor::{Device, Tensor, TensorData};
use deepfusion_kernels::position_code;
use deepfusion_model::POSITION_CHANNELS;

use super::CrossCovariance;
use crate::init::{WeightInit, WeightRng};
use crate::layers::{Bottleneck, ChannelNorm, Conv2d, Conv2dConfig, layer_scale, scaled};

/// Local-global features interaction (LGFI): with x' = x + W_p·p (p the pixels' positions) and z = x' + γ_a·A(norm(x')), A
/// attention between channels, y = x + γ·W₂·gelu(W₁·norm(z)).
#[derive(Module, Debug)]
pub struct GlobalBlock {
    /// W_p, a 1×1; only in the first stage.
    pub position: Option<Conv2d>,
    /// Norm before the attention.
    pub attention_norm: ChannelNorm,
    /// A, the attention between channels.
    pub attention: CrossCovariance,
    /// γ_a, `[channels]`.
    pub attention_scale: Param<Tensor<1>>,
    /// Norm before the bottleneck.
    pub norm: ChannelNorm,
    /// W₁ and W₂.
    pub bottleneck: Bottleneck,
    /// γ, `[channels]`.
    pub scale: Param<Tensor<1>>,
}

impl GlobalBlock {
    /// A new block.
    #[must_use]
    pub fn new(
        channels: usize,
        [heads, expansion]: [usize; 2],
        with_position: bool,
        rng: &mut WeightRng,
        device: &Device,
    ) -> Self {
        let position = with_position.then(|| {
            let mut conv = Conv2dConfig::new(2 * POSITION_CHANNELS, channels, 1);
            conv.init = WeightInit::KaimingNormalFanOut;
            conv.init(rng, device)
        });
        Self {
            position,
            attention_norm: ChannelNorm::new(channels, device),
            attention: CrossCovariance::new(channels, heads, rng, device),
            attention_scale: layer_scale(channels, device),
            norm: ChannelNorm::new(channels, device),
            bottleneck: Bottleneck::new(channels, expansion, rng, device),
            scale: layer_scale(channels, device),
        }
    }

    /// # Shapes
    /// - `x`, output: `[batch, channels, height, width]`
    pub fn forward(&self, x: Tensor<4>) -> Tensor<4> {
        let [_, _, height, width] = x.dims();
        let placed = match &self.position {
            None => x.clone(),
            Some(position) => {
                let code = position_code(POSITION_CHANNELS, height, width);
                let code = TensorData::new(code, [1, 2 * POSITION_CHANNELS, height, width]);
                let code = Tensor::from_data(code, &x.device());
                x.clone().add(position.forward(code))
            }
        };
        let seen = self
            .attention
            .forward(self.attention_norm.forward(placed.clone()));
        let mixed = placed.add(scaled(seen, &self.attention_scale));
        let inner = self.bottleneck.forward(self.norm.forward(mixed));
        x.add(scaled(inner, &self.scale))
    }
}
