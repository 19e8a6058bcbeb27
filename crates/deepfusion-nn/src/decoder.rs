//! The disparity decoder: five stages from the encoder's coarsest feature to full resolution.

use burn::module::{Module, Param};
use burn::tensor::{Device, Tensor};

use crate::init::WeightRng;
use crate::layers::{Conv2d, Conv2dConfig};
use crate::ops::{elu, sigmoid, upsample_concat};
use crate::{DecoderConfig, Error};

/// Number of scales at which disparity is predicted: 1, 1/2, 1/4, 1/8 of the input's size.
pub const SCALES: usize = 4;

/// One stage: 3×3 + ELU, nearest ×2 (except in the first stage at output stride 16), the skip feature appended, 3×3 + ELU; all
/// reflection-padded.
#[derive(Module, Debug)]
pub struct DecoderStage {
    /// Before the upsampling.
    pub reduce: Conv2d,
    /// After the concatenation.
    pub fuse: Conv2d,
    #[module(skip)]
    enlarge: bool,
}

impl DecoderStage {
    /// # Shapes
    /// - `x`: `[batch, in, height, width]`
    /// - `skip`: `[batch, skip, 2·height, 2·width]`
    /// - output: `[batch, out, 2·height, 2·width]`; without the factors 2, as for `skip`, if the stage does not enlarge
    pub fn forward(&self, x: Tensor<4>, skip: Option<Tensor<4>>) -> Tensor<4> {
        let reduced = elu(self.reduce.forward(x));
        let joined = match skip {
            skip if self.enlarge => upsample_concat(reduced, skip),
            Some(skip) => Tensor::cat(vec![reduced, skip], 1),
            None => reduced,
        };
        elu(self.fuse.forward(joined))
    }
}

/// The decoder and its four disparity heads.
#[derive(Module, Debug)]
pub struct DisparityDecoder {
    /// Coarse to fine.
    pub stages: Vec<DecoderStage>,
    /// 3×3 to one channel, by scale: `heads[0]` is the finest.
    pub heads: Vec<Conv2d>,
}

impl DisparityDecoder {
    /// A new decoder for features of `encoder_channels` (fine to coarse). If the two coarsest features have the same size (`output_stride`
    /// 16), the first stage does not enlarge. A `head_bias` makes each head start with that bias instead of a random one.
    ///
    /// # Errors
    /// As [`DecoderConfig::validate`].
    pub fn new(
        config: &DecoderConfig,
        encoder_channels: [usize; 5],
        output_stride: usize,
        head_bias: Option<f32>,
        rng: &mut WeightRng,
        device: &Device,
    ) -> Result<Self, Error> {
        config.validate()?;
        let mut channels_in = encoder_channels[4];
        let stages = (0..5)
            .map(|index| {
                let width = config.widths[index];
                // Stage 0 appends the feature at stride 16, …, stage 3 the one at stride 2, stage 4 none.
                let skip = if index < 4 {
                    encoder_channels[3 - index]
                } else {
                    0
                };
                let stage = DecoderStage {
                    reduce: Conv2dConfig::new(channels_in, width, 3)
                        .reflected()
                        .init(rng, device),
                    fuse: Conv2dConfig::new(width + skip, width, 3)
                        .reflected()
                        .init(rng, device),
                    enlarge: index > 0 || output_stride == 32,
                };
                channels_in = width;
                stage
            })
            .collect();
        let heads = (0..SCALES)
            .map(|scale| {
                let mut head = Conv2dConfig::new(config.widths[4 - scale], 1, 3)
                    .reflected()
                    .init(rng, device);
                if let Some(bias) = head_bias {
                    head.bias = Some(Param::from_data([bias], device));
                }
                head
            })
            .collect();
        Ok(Self { stages, heads })
    }

    /// σ = sigmoid(head(stage)), a disparity between the ends of the network's depth range.
    ///
    /// # Shapes
    /// - `features`: five, `[batch, channels[k], height / 2ᵏ⁺¹, width / 2ᵏ⁺¹]`; at output stride 16 the last one has the size of the one
    ///   before
    /// - output: `[batch, 1, height / 2ˢ, width / 2ˢ]` in (0, 1) for scales s = 0…3, finest first
    pub fn forward(&self, features: [Tensor<4>; 5]) -> Vec<Tensor<4>> {
        self.forward_with_feature(features).0
    }

    /// As [`Self::forward`], and the feature that the finest head reads, `[batch, widths[4], height, width]`.
    pub fn forward_with_feature(&self, features: [Tensor<4>; 5]) -> (Vec<Tensor<4>>, Tensor<4>) {
        let [f0, f1, f2, f3, f4] = features;
        let skips = [Some(f3), Some(f2), Some(f1), Some(f0), None];
        let mut x = f4;
        let mut disparities = Vec::with_capacity(SCALES);
        for (index, (stage, skip)) in self.stages.iter().zip(skips).enumerate() {
            x = stage.forward(x, skip);
            if let Some(head) = 4usize
                .checked_sub(index)
                .and_then(|scale| self.heads.get(scale))
            {
                disparities.push(sigmoid(head.forward(x.clone())));
            }
        }
        disparities.reverse();
        (disparities, x)
    }
}
