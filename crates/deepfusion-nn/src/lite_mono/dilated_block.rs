use burn::module::{Module, Param};
use burn::tensor::{Device, Tensor};

use crate::init::WeightRng;
use crate::layers::{BatchNorm2d, Bottleneck, DepthwiseConv2d, layer_scale, scaled};

/// One of the consecutive dilated convolutions (CDC): y = x + γ·W₂·gelu(W₁·bn(w ⋆ x)), w depthwise.
#[derive(Module, Debug)]
pub struct DilatedBlock {
    /// w, 3×3, dilated.
    pub depthwise: DepthwiseConv2d,
    /// Batch normalisation after `depthwise`.
    pub bn: BatchNorm2d,
    /// W₁ and W₂.
    pub bottleneck: Bottleneck,
    /// γ, `[channels]`.
    pub scale: Param<Tensor<1>>,
}

impl DilatedBlock {
    /// A new block.
    #[must_use]
    pub fn new(
        channels: usize,
        dilation: usize,
        expansion: usize,
        rng: &mut WeightRng,
        device: &Device,
    ) -> Self {
        Self {
            depthwise: DepthwiseConv2d::new(channels, 3, dilation, rng, device),
            bn: BatchNorm2d::new(channels, device),
            bottleneck: Bottleneck::new(channels, expansion, rng, device),
            scale: layer_scale(channels, device),
        }
    }

    /// # Shapes
    /// - `x`, output: `[batch, channels, height, width]`
    pub fn forward(&self, x: Tensor<4>) -> Tensor<4> {
        let seen = self.bn.forward(self.depthwise.forward(x.clone()));
        x.add(scaled(self.bottleneck.forward(seen), &self.scale))
    }
}
