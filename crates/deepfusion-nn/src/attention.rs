//! Channel and spatial attention (the paper's Eq. 13–15), and the aggregation of a global feature.

use burn::module::Module;
use burn::tensor::activation::relu;
use burn::tensor::{Device, Tensor};

use crate::init::WeightRng;
use crate::layers::{Conv2d, Conv2dConfig, global_mean};
use crate::ops::sigmoid;
use crate::{AttentionConfig, AttentionForm, Error};

/// The masks of an [`Attention`], in (0, 1).
#[derive(Debug, Clone)]
pub struct AttentionMasks {
    /// M_c, `[batch, channels, 1, 1]`.
    pub channel: Tensor<4>,
    /// M_s, `[batch, 1, height, width]`.
    pub spatial: Tensor<4>,
}

/// Two masks side by side, both computed from the feature that they act on.
#[derive(Module, Debug)]
pub struct Attention {
    /// W₁, 1×1 to the hidden layer.
    pub squeeze: Conv2d,
    /// W₂, 1×1 back to the channels.
    pub excite: Conv2d,
    /// Convolution from the channels' mean and maximum to the spatial mask.
    pub spatial: Conv2d,
    #[module(skip)]
    form: AttentionForm,
}

impl Attention {
    /// A new module for a feature of `channels` channels.
    ///
    /// # Errors
    /// As [`AttentionConfig::validate`].
    pub fn new(
        config: &AttentionConfig,
        channels: usize,
        rng: &mut WeightRng,
        device: &Device,
    ) -> Result<Self, Error> {
        config.validate()?;
        let mut conv = |from: usize, to: usize, kernel: usize| {
            let conv = Conv2dConfig::new(from, to, kernel).without_bias();
            conv.init(rng, device)
        };
        let hidden = config.hidden(channels);
        Ok(Self {
            squeeze: conv(channels, hidden, 1),
            excite: conv(hidden, channels, 1),
            spatial: conv(2, 1, config.kernel),
            form: config.form,
        })
    }

    /// M_c = σ(W₂·relu(W₁·mean(F))) over the image, M_s = σ(w ⋆ [mean_c F; max_c F]).
    ///
    /// # Shapes
    /// - `x`: `[batch, channels, height, width]`
    pub fn masks(&self, x: &Tensor<4>) -> AttentionMasks {
        let hidden = relu(self.squeeze.forward(global_mean(x.clone())));
        let extent = vec![x.clone().mean_dim(1), x.clone().max_dim(1)];
        AttentionMasks {
            channel: sigmoid(self.excite.forward(hidden)),
            spatial: sigmoid(self.spatial.forward(Tensor::cat(extent, 1))),
        }
    }

    /// The feature with its masks applied, in the configured [`AttentionForm`].
    ///
    /// # Shapes
    /// - `x`, output: `[batch, channels, height, width]`
    pub fn forward(&self, x: Tensor<4>) -> Tensor<4> {
        let masks = self.masks(&x);
        self.apply(x, masks)
    }

    /// The feature with these masks applied.
    ///
    /// # Shapes
    /// As [`Self::forward`].
    pub fn apply(&self, x: Tensor<4>, masks: AttentionMasks) -> Tensor<4> {
        // One factor for each value, so that the feature is read once.
        let both = masks.spatial.mul(masks.channel);
        match self.form {
            AttentionForm::Product => x.mul(both),
            AttentionForm::Residual => x.mul(both.add_scalar(1.0)),
        }
    }
}

/// Global feature aggregation: the channels' means over the image, projected and added at every pixel.
#[derive(Module, Debug)]
pub struct GlobalAggregation {
    /// 1×1 on the mean over the image.
    pub project: Conv2d,
}

impl GlobalAggregation {
    /// A new module for a feature of `channels` channels.
    #[must_use]
    pub fn new(channels: usize, rng: &mut WeightRng, device: &Device) -> Self {
        Self {
            project: Conv2dConfig::new(channels, channels, 1).init(rng, device),
        }
    }

    /// x + W·mean(x) + b.
    ///
    /// # Shapes
    /// - `x`, output: `[batch, channels, height, width]`
    pub fn forward(&self, x: Tensor<4>) -> Tensor<4> {
        let global = self.project.forward(global_mean(x.clone()));
        x.add(global)
    }
}
