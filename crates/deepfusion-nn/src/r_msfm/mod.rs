//! R-MSFM (Zhou et al., "R-MSFM: Recurrent Multi-Scale Feature Modulation for Monocular Depth Estimating", ICCV 2021): a gated unit reads
//! the features of half a ResNet-18 from coarse to fine, and its state refines one disparity at an eighth of the image's size.

mod encoder;
mod features;
mod gru;
mod strip;
mod update;

pub use encoder::HalfResNet;
pub use features::{Context, Features};
pub use gru::{GatedUnit, SeparableGru};
pub use strip::Strip;
pub use update::{ConvexWeights, Update};

use burn::module::Module;
use burn::tensor::{Device, Tensor};

use crate::init::WeightRng;
use crate::ops::sigmoid;
use crate::{Error, InputNormalisation, RMsfmConfig};

/// Encoder, gated unit and refinement.
#[derive(Module, Debug)]
pub struct RMsfm {
    /// The encoder, with three features.
    pub encoder: HalfResNet,
    /// Brings them to an eighth of the image's size.
    pub features: Features,
    /// Updates the state with a feature.
    pub gru: SeparableGru,
    /// Refines the disparity.
    pub update: Update,
    /// Weights for the disparity's enlargement.
    pub weights: ConvexWeights,
    #[module(skip)]
    iterations: usize,
    #[module(skip)]
    start: f32,
}

impl RMsfm {
    /// A new network. `start` is the logit of the initial disparity, the same at every pixel.
    ///
    /// # Errors
    /// As [`RMsfmConfig::validate`].
    pub fn new(
        config: &RMsfmConfig,
        normalisation: InputNormalisation,
        start: f32,
        rng: &mut WeightRng,
        device: &Device,
    ) -> Result<Self, Error> {
        config.validate()?;
        Ok(Self {
            encoder: HalfResNet::new(normalisation, rng, device),
            features: Features::new(config.twice(), rng, device),
            gru: SeparableGru::new(rng, device),
            update: Update::new(rng, device),
            weights: ConvexWeights::new(rng, device),
            iterations: config.iterations,
            start,
        })
    }

    /// Sigmoid disparities after each refinement, the last one first.
    ///
    /// # Shapes
    /// - `images`: `[batch, 3, height, width]`, RGB in [0, 1]
    /// - output: one for each refinement, `[batch, 1, height, width]` in (0, 1)
    pub fn forward(&self, images: Tensor<4>) -> Vec<Tensor<4>> {
        self.disparities(self.encoder.forward(images))
    }

    /// As [`Self::forward`], from the encoder's features.
    ///
    /// # Shapes
    /// - `features`: those of [`HalfResNet::forward`]
    pub fn disparities(&self, features: [Tensor<4>; 3]) -> Vec<Tensor<4>> {
        let mut state = self.features.first(&features);
        let [batch, _, height, width] = state.dims();
        let mut logit = Tensor::full([batch, 1, height, width], self.start, &state.device());
        let mut disparities = Vec::with_capacity(self.iterations);
        let config = RMsfmConfig {
            iterations: self.iterations,
        };
        for index in 0..config.iterations {
            if index > 0 {
                let input = config.refinement_input(index);
                let seen = self.features.next(input, &features, state.clone());
                state = self.gru.forward(state, seen);
            }
            let (refined, seen) = self.update.forward(state.clone(), logit);
            disparities.push(self.weights.enlarged(sigmoid(refined.clone()), seen));
            logit = refined;
        }
        disparities.reverse();
        disparities
    }
}
