//! PoseNet: the motion between two frames (SPEC 1.2).

use burn::module::Module;
use burn::tensor::{Device, Tensor, activation::relu};
use serde::{Deserialize, Serialize};

use crate::Error;
use crate::init::WeightRng;
use crate::layers::{Conv2d, Conv2dConfig};
use crate::resnet::{InputNormalisation, ResNet, ResNetConfig, ResNetDepth};

/// Channels between the pose decoder's convolutions.
pub(crate) const WIDTH: usize = 256;

/// Radians per unit of the raw output: a new network then starts near no rotation at all.
pub const RADIANS_PER_UNIT: f64 = 0.01;

/// What a [`PoseNet`] is built from.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields)]
pub struct PoseNetConfig {
    /// The backbone, on two frames.
    pub encoder: ResNetConfig,
    /// How many poses the last convolution has channels for (six each); the first is used.
    #[serde(default = "one_pose")]
    pub poses: usize,
    /// Metres of translation per unit of the raw output. The data's mean displacement per pair
    /// keeps the raw output near one.
    #[serde(default = "one_metre")]
    pub metres_per_unit: f64,
}

fn one_pose() -> usize {
    1
}

fn one_metre() -> f64 {
    1.0
}

impl PoseNetConfig {
    /// The published ResNet on two frames, one pose, one metre per unit.
    #[must_use]
    pub fn new(depth: ResNetDepth) -> Self {
        Self {
            encoder: ResNetConfig::new(depth).with_frames(2),
            poses: one_pose(),
            metres_per_unit: one_metre(),
        }
    }

    /// Monodepth2's network: its normalisation, twelve outputs of which the first six are used,
    /// translation × 0.01 (in units of its own: its scale is not metric).
    #[must_use]
    pub fn monodepth2(depth: ResNetDepth) -> Self {
        Self {
            encoder: ResNetConfig::new(depth)
                .with_frames(2)
                .with_normalisation(InputNormalisation::Monodepth),
            poses: 2,
            metres_per_unit: 0.01,
        }
    }

    /// # Errors
    /// [`Error::Config`] for a network that cannot be built, or a factor that is not positive.
    pub fn validate(&self) -> Result<(), Error> {
        self.encoder.validate()?;
        if self.encoder.frames < 2 {
            return Err(Error::config(
                "pose.encoder.frames",
                "2 (a pose network sees a pair)",
                self.encoder.frames,
            ));
        }
        if !(1..=16).contains(&self.poses) {
            return Err(Error::config("pose.poses", "1 to 16", self.poses));
        }
        if !(self.metres_per_unit > 0.0 && self.metres_per_unit.is_finite()) {
            return Err(Error::config(
                "pose.metres_per_unit",
                "a positive number of metres",
                self.metres_per_unit,
            ));
        }
        Ok(())
    }

    /// A new network with the weights of seed 0.
    ///
    /// # Errors
    /// As [`Self::validate`].
    pub fn init(&self, device: &Device) -> Result<PoseNet, Error> {
        self.init_with_seed(0, device)
    }

    /// A new network whose weights depend on `seed` alone.
    ///
    /// # Errors
    /// As [`Self::validate`].
    pub fn init_with_seed(&self, seed: u64, device: &Device) -> Result<PoseNet, Error> {
        self.validate()?;
        // Not the numbers the depth network of the same seed starts from.
        let mut rng = WeightRng::with_stream(seed, 1);
        let encoder = self.encoder.init(&mut rng, device)?;
        let mut conv = |channels_in: usize, channels_out: usize, kernel: usize| {
            Conv2dConfig::new(channels_in, channels_out, kernel).init(&mut rng, device)
        };
        let decoder = PoseDecoder {
            squeeze: conv(self.encoder.channels()[4], WIDTH, 1),
            conv1: conv(WIDTH, WIDTH, 3),
            conv2: conv(WIDTH, WIDTH, 3),
            output: conv(WIDTH, 6 * self.poses, 1),
        };
        Ok(PoseNet {
            encoder,
            decoder,
            metres_per_unit: self.metres_per_unit,
        })
    }
}

/// A rigid motion per sample, as the network predicts it.
#[derive(Debug, Clone)]
pub struct PoseOutput {
    /// `[batch, 3]`: the rotation's axis times its angle, in radians.
    pub axis_angle: Tensor<2>,
    /// `[batch, 3]`: the translation, in metres.
    pub translation: Tensor<2>,
}

/// From the encoder's coarsest feature to six numbers a pose.
#[derive(Module, Debug)]
pub struct PoseDecoder {
    /// 1×1 to 256, ReLU.
    pub squeeze: Conv2d,
    /// 3×3, ReLU.
    pub conv1: Conv2d,
    /// 3×3, ReLU.
    pub conv2: Conv2d,
    /// 1×1 to six numbers a pose.
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

/// The camera's motion between the two stacked frames. Which way it points is the trainer's matter:
/// the network is only ever given the frames in time order.
#[derive(Module, Debug)]
pub struct PoseNet {
    /// The backbone.
    pub encoder: ResNet,
    /// The decoder.
    pub decoder: PoseDecoder,
    #[module(skip)]
    metres_per_unit: f64,
}

impl PoseNet {
    /// axis-angle = 0.01·o₀…₂, translation = `metres_per_unit`·o₃…₅, o the first pose's raw output.
    ///
    /// # Shapes
    /// - `stacked`: `[batch, 6, height, width]`, two RGB images in [0, 1] in time order
    /// - output: `[batch, 3]` twice
    pub fn forward(&self, stacked: Tensor<4>) -> PoseOutput {
        let [.., coarsest] = self.encoder.forward(stacked);
        let raw = self.decoder.forward(coarsest);
        PoseOutput {
            axis_angle: raw.clone().narrow(1, 0, 3).mul_scalar(RADIANS_PER_UNIT),
            translation: raw.narrow(1, 3, 3).mul_scalar(self.metres_per_unit),
        }
    }

    /// Metres of translation per unit of the raw output.
    #[must_use]
    pub fn metres_per_unit(&self) -> f64 {
        self.metres_per_unit
    }
}
