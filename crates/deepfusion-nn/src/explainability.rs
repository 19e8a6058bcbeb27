//! Explainability (Zhou et al., "Unsupervised Learning of Depth and Ego-Motion from Video", CVPR 2017): how well a warp between two frames
//! can explain them, pixel by pixel.

use burn::module::Module;
use burn::tensor::{Device, Tensor, activation::relu};

use crate::init::{WeightInit, WeightRng};
use crate::layers::{Conv2d, Conv2dConfig};
use crate::ops;
use crate::resample::doubled;
use deepfusion_model::EXPLAINABILITY_WIDTHS;

/// Computes a mask for each of two frames from the pose network's coarsest feature.
#[derive(Module, Debug)]
pub struct Explainability {
    /// 3×3 with ReLU, coarse to fine; the feature is enlarged by 2 before each layer except the first.
    pub layers: Vec<Conv2d>,
    /// 3×3 to the masks' logits, at half of the frames' size.
    pub head: Conv2d,
}

impl Explainability {
    /// A new module for a feature of `channels` channels, with Xavier's weights.
    pub(crate) fn new(channels: usize, rng: &mut WeightRng, device: &Device) -> Self {
        let mut from = channels;
        let mut conv = |to: usize| {
            let mut config = Conv2dConfig::new(from, to, 3);
            config.init = WeightInit::XavierUniform;
            from = to;
            config.init(rng, device)
        };
        let layers = EXPLAINABILITY_WIDTHS.into_iter().map(&mut conv).collect();
        Self {
            layers,
            head: conv(2),
        }
    }

    /// ln(E / (1 − E)) of the first and the second frame's masks E.
    ///
    /// # Shapes
    /// - `feature`: `[batch, channels, height / 32, width / 32]`
    /// - output: `[batch, 2, height, width]`
    pub fn forward(&self, feature: Tensor<4>) -> Tensor<4> {
        let mut x = feature;
        for (index, layer) in self.layers.iter().enumerate() {
            if index > 0 {
                x = ops::upsample_concat(x, None);
            }
            x = relu(layer.forward(x));
        }
        doubled(self.head.forward(x))
    }
}
