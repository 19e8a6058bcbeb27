//! PoseNet: the motion between two frames.

use burn::module::Module;
use burn::tensor::{Device, Tensor, activation::relu};

use crate::explainability::Explainability;
use crate::init::WeightRng;
use crate::layers::{Conv2d, Conv2dConfig};
use crate::resnet::ResNet;
use crate::weights::{Weights, apply_but_for};
use crate::{Error, PoseNetConfig};
use deepfusion_model::POSE_WIDTH;

/// Radians per unit of the raw output: small, so that a new network starts with almost no rotation.
pub const RADIANS_PER_UNIT: f64 = 0.01;

/// A rigid motion per sample, as the network predicts it.
#[derive(Debug, Clone)]
pub struct PoseOutput {
    /// `[batch, 3]`: the rotation's axis times its angle, in radians.
    pub axis_angle: Tensor<2>,
    /// `[batch, 3]`: the translation, in metres.
    pub translation: Tensor<2>,
}

/// Computes six numbers per pose from the encoder's coarsest feature.
#[derive(Module, Debug)]
pub struct PoseDecoder {
    /// 1×1 to 256, ReLU.
    pub squeeze: Conv2d,
    /// 3×3, ReLU.
    pub conv1: Conv2d,
    /// 3×3, ReLU.
    pub conv2: Conv2d,
    /// 1×1 to six numbers per pose.
    pub output: Conv2d,
}

impl PoseDecoder {
    /// The raw outputs, averaged over the image.
    ///
    /// # Shapes
    /// - `feature`: `[batch, channels, height, width]`
    /// - output: `[batch, 6·poses]`
    pub fn forward(&self, feature: Tensor<4>) -> Tensor<2> {
        let x = relu(self.squeeze.forward(feature));
        let x = relu(self.conv1.forward(x));
        let x = relu(self.conv2.forward(x));
        let x = self.output.forward(x);
        let [batch, channels, height, width] = x.dims();
        x.reshape([batch, channels, height * width])
            .mean_dim(2)
            .reshape([batch, channels])
    }
}

/// Predicts the camera's motion between two stacked frames. The network always gets the frames in time order, and the trainer decides on
/// the direction.
#[derive(Module, Debug)]
pub struct PoseNet {
    /// The ResNet encoder.
    pub encoder: ResNet,
    /// The decoder.
    pub decoder: PoseDecoder,
    /// The explainability masks, if the network has them.
    pub explainability: Option<Explainability>,
    #[module(skip)]
    metres_per_unit: f64,
}

impl PoseNet {
    /// A new network with the weights of seed 0.
    ///
    /// # Errors
    /// As [`PoseNetConfig::validate`].
    pub fn new(config: &PoseNetConfig, device: &Device) -> Result<Self, Error> {
        Self::with_seed(config, 0, device)
    }

    /// A new network whose weights depend on `seed` alone.
    ///
    /// # Errors
    /// As [`PoseNetConfig::validate`].
    pub fn with_seed(config: &PoseNetConfig, seed: u64, device: &Device) -> Result<Self, Error> {
        config.validate()?;
        // A different random stream than that of the depth network with the same seed.
        let mut rng = WeightRng::with_stream(seed, 1);
        let encoder = ResNet::new(&config.encoder, &mut rng, device)?;
        let mut conv = |channels_in: usize, channels_out: usize, kernel: usize| {
            Conv2dConfig::new(channels_in, channels_out, kernel).init(&mut rng, device)
        };
        let decoder = PoseDecoder {
            squeeze: conv(config.encoder.channels()[4], POSE_WIDTH, 1),
            conv1: conv(POSE_WIDTH, POSE_WIDTH, 3),
            conv2: conv(POSE_WIDTH, POSE_WIDTH, 3),
            output: conv(POSE_WIDTH, 6 * config.poses, 1),
        };
        // Drawn last, so that the other weights are the same for a seed with or without it.
        let channels = config.encoder.channels()[4];
        let explainability = config
            .explainability
            .then(|| Explainability::new(channels, &mut rng, device));
        Ok(Self {
            encoder,
            decoder,
            explainability,
            metres_per_unit: config.metres_per_unit,
        })
    }

    /// axis-angle = 0.01·o₀…₂, translation = `metres_per_unit`·o₃…₅, where o is the first pose's raw output.
    ///
    /// # Shapes
    /// - `stacked`: `[batch, 6, height, width]`, two RGB images in [0, 1] in time order
    /// - output: twice `[batch, 3]`
    pub fn forward(&self, stacked: Tensor<4>) -> PoseOutput {
        let [.., coarsest] = self.encoder.forward(stacked);
        self.motion(coarsest)
    }

    /// As [`Self::forward`], and the logits of the explainability masks, if the network has them.
    ///
    /// # Shapes
    /// - `stacked`: as for [`Self::forward`]
    /// - output: as from [`Self::forward`]; `[batch, 2, height, width]`, for the first and the second image
    pub fn forward_explained(&self, stacked: Tensor<4>) -> (PoseOutput, Option<Tensor<4>>) {
        let [.., coarsest] = self.encoder.forward(stacked);
        let masks = self.explainability.as_ref();
        let logits = masks.map(|net| net.forward(coarsest.clone()));
        (self.motion(coarsest), logits)
    }

    fn motion(&self, coarsest: Tensor<4>) -> PoseOutput {
        let raw = self.decoder.forward(coarsest);
        PoseOutput {
            axis_angle: raw.clone().narrow(1, 0, 3).mul_scalar(RADIANS_PER_UNIT),
            translation: raw.narrow(1, 3, 3).mul_scalar(self.metres_per_unit),
        }
    }

    /// The network with these weights, which must fit it, except for the explainability masks. If the weights lack the masks, the network
    /// keeps its own; if the network lacks them, the weights' masks are ignored. Returns whether the masks are new.
    ///
    /// # Errors
    /// As [`weights::apply`](crate::weights::apply).
    pub fn with_weights(self, weights: &Weights) -> Result<(Self, bool), Error> {
        apply_but_for(self, weights, "explainability.")
    }

    /// Metres of translation per unit of the raw output.
    #[must_use]
    pub fn metres_per_unit(&self) -> f64 {
        self.metres_per_unit
    }
}
