//! ResNet encoders in torchvision's layout and with its parameter names.

use burn::module::Module;
use burn::tensor::{Device, Tensor};
use serde::{Deserialize, Serialize};

use crate::Error;
use crate::init::WeightRng;
use crate::layers::{BatchNorm2d, Conv2d, Conv2dConfig, freeze_statistics, max_pool_3x3_stride_2};
use crate::residual_block::{BlockConfig, ResidualBlock};

/// Which of the published ResNets.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(rename_all = "lowercase")]
pub enum ResNetDepth {
    /// 2, 2, 2, 2 basic blocks.
    ResNet18,
    /// 3, 4, 6, 3 basic blocks.
    ResNet34,
    /// 3, 4, 6, 3 bottleneck blocks.
    ResNet50,
    /// 3, 4, 23, 3 bottleneck blocks.
    ResNet101,
}

impl ResNetDepth {
    /// All of them.
    pub const ALL: [Self; 4] = [
        Self::ResNet18,
        Self::ResNet34,
        Self::ResNet50,
        Self::ResNet101,
    ];

    /// Blocks in `layer1`…`layer4`.
    #[must_use]
    pub fn blocks(self) -> [usize; 4] {
        match self {
            Self::ResNet18 => [2, 2, 2, 2],
            Self::ResNet34 | Self::ResNet50 => [3, 4, 6, 3],
            Self::ResNet101 => [3, 4, 23, 3],
        }
    }

    /// Whether a block is 1×1, 3×3, 1×1 (50, 101) rather than 3×3, 3×3 (18, 34).
    #[must_use]
    pub fn is_bottleneck(self) -> bool {
        matches!(self, Self::ResNet50 | Self::ResNet101)
    }

    /// Output channels of a block per channel of its 3×3 convolution.
    #[must_use]
    pub fn expansion(self) -> usize {
        if self.is_bottleneck() { 4 } else { 1 }
    }
}

/// How images in [0, 1] are brought to what an encoder's first convolution expects.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(rename_all = "lowercase")]
pub enum InputNormalisation {
    /// (x − mean) / std per channel, with ImageNet's statistics.
    ImageNet,
    /// (x − 0.45) / 0.225 on every channel.
    Monodepth,
}

impl InputNormalisation {
    /// Mean of red, green and blue.
    #[must_use]
    pub fn mean(self) -> [f32; 3] {
        match self {
            Self::ImageNet => [0.485, 0.456, 0.406],
            Self::Monodepth => [0.45; 3],
        }
    }

    /// Standard deviation of red, green and blue.
    #[must_use]
    pub fn std(self) -> [f32; 3] {
        match self {
            Self::ImageNet => [0.229, 0.224, 0.225],
            Self::Monodepth => [0.225; 3],
        }
    }

    /// (x − mean) / std, the three channels of each frame alike.
    ///
    /// # Shapes
    /// - `images`, output: `[batch, 3·frames, height, width]`
    #[must_use]
    pub fn apply(self, images: Tensor<4>) -> Tensor<4> {
        let channels = images.dims()[1];
        let device = images.device();
        let per_channel = |values: [f32; 3]| {
            let repeated: Vec<f32> = values.into_iter().cycle().take(channels).collect();
            Tensor::<1>::from_floats(repeated.as_slice(), &device).reshape([1, channels, 1, 1])
        };
        images
            .sub(per_channel(self.mean()))
            .div(per_channel(self.std()))
    }
}

/// What a [`ResNet`] is built from.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields)]
pub struct ResNetConfig {
    /// The layout.
    pub depth: ResNetDepth,
    /// Channels of the first convolution; 64 is the published network, less is a narrower one
    /// that torchvision's weights do not fit.
    #[serde(default = "default_base_width")]
    pub base_width: usize,
    /// Images stacked along the channels: 1, or 2 for a pose network.
    #[serde(default = "default_frames")]
    pub frames: usize,
    /// Applied to the input first.
    #[serde(default = "default_normalisation")]
    pub normalisation: InputNormalisation,
    /// Whether the batch norms keep their running statistics while training (for batches too small
    /// to have statistics of their own; needs imported weights). Of a depth network these are all its batch norms,
    /// the context encoding's too.
    #[serde(default)]
    pub frozen_statistics: bool,
    /// By what the coarsest feature is smaller than the image: 32, or 16. At 16 `layer4` keeps the stride of
    /// 1 and its 3×3 convolutions are dilated instead, by 2 × `multi_grid` (DeepLabv3); its weights are the
    /// same ones.
    #[serde(default = "default_output_stride")]
    pub output_stride: usize,
    /// The dilation of `layer4`'s blocks over 2, at output stride 16; cut to as many as there are blocks.
    #[serde(default = "default_multi_grid")]
    pub multi_grid: [usize; 3],
}

fn default_base_width() -> usize {
    64
}

fn default_frames() -> usize {
    1
}

fn default_normalisation() -> InputNormalisation {
    InputNormalisation::ImageNet
}

fn default_output_stride() -> usize {
    32
}

fn default_multi_grid() -> [usize; 3] {
    [1, 2, 4]
}

impl ResNetConfig {
    /// The published network on single images, normalised as ImageNet.
    #[must_use]
    pub fn new(depth: ResNetDepth) -> Self {
        Self {
            depth,
            base_width: default_base_width(),
            frames: default_frames(),
            normalisation: default_normalisation(),
            frozen_statistics: false,
            output_stride: default_output_stride(),
            multi_grid: default_multi_grid(),
        }
    }

    /// The same on `frames` images stacked along the channels.
    #[must_use]
    pub fn with_frames(mut self, frames: usize) -> Self {
        self.frames = frames;
        self
    }

    /// The same with another width.
    #[must_use]
    pub fn with_base_width(mut self, base_width: usize) -> Self {
        self.base_width = base_width;
        self
    }

    /// The same with another input normalisation.
    #[must_use]
    pub fn with_normalisation(mut self, normalisation: InputNormalisation) -> Self {
        self.normalisation = normalisation;
        self
    }

    /// The same with another output stride.
    #[must_use]
    pub fn with_output_stride(mut self, output_stride: usize) -> Self {
        self.output_stride = output_stride;
        self
    }

    /// Whether `layer4` dilates where the published network halves the image.
    #[must_use]
    pub fn is_dilated(&self) -> bool {
        self.output_stride == 16
    }

    /// Stride and dilation of a block of `layer1`…`layer4` (0…3).
    pub(crate) fn steps(&self, layer: usize, block: usize) -> [usize; 2] {
        if layer == 3 && self.is_dilated() {
            return [1, 2 * self.multi_grid[block.min(2)]];
        }
        [if layer > 0 && block == 0 { 2 } else { 1 }, 1]
    }

    /// Channels of the five features, at strides 2, 4, 8, 16 and the output stride.
    #[must_use]
    pub fn channels(&self) -> [usize; 5] {
        let (w, e) = (self.base_width, self.depth.expansion());
        [w, w * e, 2 * w * e, 4 * w * e, 8 * w * e]
    }

    /// # Errors
    /// [`Error::Config`] for a width or a number of frames that no network has.
    pub fn validate(&self) -> Result<(), Error> {
        if !(1..=1024).contains(&self.base_width) {
            return Err(Error::config(
                "encoder.base_width",
                "1 to 1024",
                self.base_width,
            ));
        }
        if !(1..=16).contains(&self.frames) {
            return Err(Error::config("encoder.frames", "1 to 16", self.frames));
        }
        if !matches!(self.output_stride, 16 | 32) {
            let found = self.output_stride;
            return Err(Error::config("encoder.output_stride", "16 or 32", found));
        }
        if self.multi_grid.iter().any(|rate| !(1..=16).contains(rate)) {
            let found = self.multi_grid;
            return Err(Error::config(
                "encoder.multi_grid",
                "three factors of 1 to 16",
                found,
            ));
        }
        Ok(())
    }

    /// A new encoder with weights drawn as torchvision draws them.
    ///
    /// # Errors
    /// As [`Self::validate`].
    pub fn init(&self, rng: &mut WeightRng, device: &Device) -> Result<ResNet, Error> {
        self.validate()?;
        let conv1 = Conv2dConfig::before_batch_norm(3 * self.frames, self.base_width, 7, 2)
            .init(rng, device);
        let mut channels_in = self.base_width;
        let mut layer = |index: usize, rng: &mut WeightRng| {
            let width = self.base_width << index;
            (0..self.depth.blocks()[index])
                .map(|block| {
                    let [stride, dilation] = self.steps(index, block);
                    let config = BlockConfig {
                        depth: self.depth,
                        channels_in,
                        width,
                        stride,
                        dilation,
                    };
                    channels_in = width * self.depth.expansion();
                    ResidualBlock::new(config, rng, device)
                })
                .collect()
        };
        let resnet = ResNet {
            conv1,
            bn1: BatchNorm2d::new(self.base_width, device),
            layer1: layer(0, rng),
            layer2: layer(1, rng),
            layer3: layer(2, rng),
            layer4: layer(3, rng),
            normalisation: self.normalisation,
        };
        Ok(freeze_statistics(resnet, self.frozen_statistics))
    }
}

/// A ResNet without its classifier. The fields carry torchvision's names, so that the path of a
/// tensor, such as `layer1.0.conv1.weight`, is its name in torchvision's files.
#[derive(Module, Debug)]
pub struct ResNet {
    /// 7×7 at stride 2.
    pub conv1: Conv2d,
    /// After `conv1`.
    pub bn1: BatchNorm2d,
    /// Stride 4.
    pub layer1: Vec<ResidualBlock>,
    /// Stride 8.
    pub layer2: Vec<ResidualBlock>,
    /// Stride 16.
    pub layer3: Vec<ResidualBlock>,
    /// Stride 32, or 16 and dilated.
    pub layer4: Vec<ResidualBlock>,
    #[module(skip)]
    normalisation: InputNormalisation,
}

impl ResNet {
    /// f₀ = relu(bn₁(conv₁(x))), f₁ = layer₁(maxpool(f₀)), fₖ = layerₖ(fₖ₋₁) (Eq. 10).
    ///
    /// # Shapes
    /// - `images`: `[batch, 3·frames, height, width]`, RGB in [0, 1]
    /// - output: five features `[batch, channels[k], height / 2ᵏ⁺¹, width / 2ᵏ⁺¹]`, k = 0…4; the last one is as
    ///   large as the one before it at output stride 16
    pub fn forward(&self, images: Tensor<4>) -> [Tensor<4>; 5] {
        let x = self.normalisation.apply(images);
        let f0 = self.bn1.forward_relu(self.conv1.forward(x));
        let f1 = run(&self.layer1, max_pool_3x3_stride_2(f0.clone()));
        let f2 = run(&self.layer2, f1.clone());
        let f3 = run(&self.layer3, f2.clone());
        let f4 = run(&self.layer4, f3.clone());
        [f0, f1, f2, f3, f4]
    }

    /// The normalisation applied to the input.
    #[must_use]
    pub fn normalisation(&self) -> InputNormalisation {
        self.normalisation
    }
}

fn run(layer: &[ResidualBlock], x: Tensor<4>) -> Tensor<4> {
    layer.iter().fold(x, |x, block| block.forward(x))
}
