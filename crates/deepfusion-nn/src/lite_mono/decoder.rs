use burn::module::{Module, Param};
use burn::tensor::{Device, Tensor};

use crate::LiteMonoConfig;
use crate::init::{WeightInit, WeightRng};
use crate::layers::{Conv2d, Conv2dConfig};
use crate::ops::{elu, sigmoid};
use crate::resample::doubled;

/// Number of scales at which Lite-Mono predicts disparity: 1, 1/2, 1/4 of the input's size.
pub const LITE_MONO_SCALES: usize = 3;

/// One stage: 3×3 + ELU, bilinear ×2, the skip feature appended, 3×3 + ELU; both reflection-padded.
#[derive(Module, Debug)]
pub struct SmoothStage {
    /// Before the enlargement.
    pub reduce: Conv2d,
    /// After the concatenation.
    pub fuse: Conv2d,
}

impl SmoothStage {
    /// # Shapes
    /// - `x`: `[batch, in, height, width]`
    /// - `skip`: `[batch, skip, 2·height, 2·width]`
    /// - output: `[batch, out, 2·height, 2·width]`
    pub fn forward(&self, x: Tensor<4>, skip: Option<Tensor<4>>) -> Tensor<4> {
        let large = doubled(elu(self.reduce.forward(x)));
        let joined = match skip {
            Some(skip) => Tensor::cat(vec![large, skip], 1),
            None => large,
        };
        elu(self.fuse.forward(joined))
    }
}

/// Lite-Mono's decoder: three stages from the coarsest feature to half of the image's size, and a head for each, whose output is
/// enlarged.
#[derive(Module, Debug)]
pub struct SmoothDecoder {
    /// Coarse to fine.
    pub stages: Vec<SmoothStage>,
    /// 3×3 to one channel, by scale: `heads[0]` is the finest.
    pub heads: Vec<Conv2d>,
}

impl SmoothDecoder {
    /// A new decoder of a valid configuration.
    pub(super) fn new(
        config: &LiteMonoConfig,
        head_bias: Option<f32>,
        rng: &mut WeightRng,
        device: &Device,
    ) -> Self {
        let mut conv = |from: usize, to: usize| {
            let mut conv = Conv2dConfig::new(from, to, 3).reflected();
            conv.init = WeightInit::Normal2Percent;
            conv.init(rng, device)
        };
        let widths = config.decoder_widths();
        let [skip_0, skip_1, mut from] = config.widths;
        let stages = [(widths[2], skip_1), (widths[1], skip_0), (widths[0], 0)];
        let stages = stages.map(|(width, skip)| {
            let stage = SmoothStage {
                reduce: conv(from, width),
                fuse: conv(width + skip, width),
            };
            from = width;
            stage
        });
        let heads = widths.map(|width| {
            let mut head = conv(width, 1);
            if let Some(bias) = head_bias {
                head.bias = Some(Param::from_data([bias], device));
            }
            head
        });
        Self {
            stages: stages.into(),
            heads: heads.into(),
        }
    }

    /// # Shapes
    /// - `features`: three, those of [`LiteMonoEncoder::forward`](super::LiteMonoEncoder::forward)
    /// - output: `[batch, 1, height / 2ˢ, width / 2ˢ]` in (0, 1) for scales s = 0…2, finest first
    pub fn forward(&self, features: Vec<Tensor<4>>) -> Vec<Tensor<4>> {
        self.forward_with_feature(features).0
    }

    /// As [`Self::forward`], and the feature that the finest head reads, `[batch, widths[0] / 2, height / 2, width / 2]`.
    ///
    /// # Panics
    /// Unless there are three features.
    pub fn forward_with_feature(
        &self,
        mut features: Vec<Tensor<4>>,
    ) -> (Vec<Tensor<4>>, Tensor<4>) {
        assert_eq!(features.len(), LITE_MONO_SCALES, "one feature a stage");
        let mut x = features.swap_remove(2);
        let mut disparities = Vec::with_capacity(LITE_MONO_SCALES);
        for (stage, head) in self.stages.iter().zip(self.heads.iter().rev()) {
            x = stage.forward(x, features.pop());
            disparities.push(sigmoid(doubled(head.forward(x.clone()))));
        }
        disparities.reverse();
        (disparities, x)
    }
}
