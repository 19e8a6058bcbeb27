//! Lite-Mono (Zhang et al., CVPR 2023, arXiv 2211.13202): a light encoder of dilated convolutions and cross-covariance
//! attention, and a decoder of three scales.

mod attention;
mod decoder;
mod dilated_block;
mod encoder;
mod global_block;

pub use attention::CrossCovariance;
pub use decoder::{LITE_MONO_SCALES, SmoothDecoder, SmoothStage};
pub use dilated_block::DilatedBlock;
pub use encoder::{LiteMonoEncoder, LiteMonoStage};
pub use global_block::GlobalBlock;

use burn::module::Module;
use burn::tensor::{Device, Tensor};

use crate::init::WeightRng;
use crate::{Error, InputNormalisation, LiteMonoConfig};

/// Encoder and decoder.
#[derive(Module, Debug)]
pub struct LiteMono {
    /// The encoder, with three features.
    pub encoder: LiteMonoEncoder,
    /// The decoder, from these features to disparities.
    pub decoder: SmoothDecoder,
}

impl LiteMono {
    /// A new network. A `head_bias` makes each head start with that bias instead of 0.
    ///
    /// # Errors
    /// As [`LiteMonoConfig::validate`].
    pub fn new(
        config: &LiteMonoConfig,
        normalisation: InputNormalisation,
        head_bias: Option<f32>,
        rng: &mut WeightRng,
        device: &Device,
    ) -> Result<Self, Error> {
        config.validate()?;
        Ok(Self {
            encoder: LiteMonoEncoder::new(config, normalisation, rng, device),
            decoder: SmoothDecoder::new(config, head_bias, rng, device),
        })
    }

    /// Sigmoid disparities, as from [`DepthNet::forward`](crate::DepthNet::forward), but at three scales.
    ///
    /// # Shapes
    /// - `images`: `[batch, 3, height, width]`, RGB in [0, 1]
    /// - output: `[batch, 1, height / 2ˢ, width / 2ˢ]` in (0, 1) for scales s = 0…2, finest first
    pub fn forward(&self, images: Tensor<4>) -> Vec<Tensor<4>> {
        self.decoder.forward(self.encoder.forward(images))
    }
}
