//! ResNet encoders in torchvision's layout and with its parameter names.

use burn::module::Module;
use burn::tensor::{Device, Tensor, activation::relu};
use serde::{Deserialize, Serialize};

use crate::Error;
use crate::init::WeightRng;
use crate::layers::{BatchNorm2d, Conv2d, Conv2dConfig, freeze_statistics, max_pool_3x3_stride_2};

/// Which of the published ResNets.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
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
    /// to have statistics of their own; needs imported weights).
    #[serde(default)]
    pub frozen_statistics: bool,
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

    /// Channels of the five features, at strides 2, 4, 8, 16 and 32.
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
        let [b1, b2, b3, b4] = self.depth.blocks();
        let mut channels_in = self.base_width;
        let mut layer = |blocks: usize, width: usize, stride: usize, rng: &mut WeightRng| {
            (0..blocks)
                .map(|index| {
                    let stride = if index == 0 { stride } else { 1 };
                    let block =
                        ResidualBlock::new(self.depth, channels_in, width, stride, rng, device);
                    channels_in = width * self.depth.expansion();
                    block
                })
                .collect()
        };
        let w = self.base_width;
        let resnet = ResNet {
            conv1,
            bn1: BatchNorm2d::new(w, device),
            layer1: layer(b1, w, 1, rng),
            layer2: layer(b2, 2 * w, 2, rng),
            layer3: layer(b3, 4 * w, 2, rng),
            layer4: layer(b4, 8 * w, 2, rng),
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
    /// Stride 32.
    pub layer4: Vec<ResidualBlock>,
    #[module(skip)]
    normalisation: InputNormalisation,
}

impl ResNet {
    /// f₀ = relu(bn₁(conv₁(x))), f₁ = layer₁(maxpool(f₀)), fₖ = layerₖ(fₖ₋₁) (Eq. 10).
    ///
    /// # Shapes
    /// - `images`: `[batch, 3·frames, height, width]`, RGB in [0, 1]
    /// - output: five features `[batch, channels[k], height / 2ᵏ⁺¹, width / 2ᵏ⁺¹]`, k = 0…4
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

/// One residual block: basic (two 3×3 convolutions), or bottleneck (1×1, 3×3, 1×1) where `conv3`
/// is there. The stride sits in the 3×3 convolution of a bottleneck, as in torchvision.
#[derive(Module, Debug)]
pub struct ResidualBlock {
    /// Basic: 3×3 with the stride. Bottleneck: 1×1 to the block's width.
    pub conv1: Conv2d,
    /// After `conv1`.
    pub bn1: BatchNorm2d,
    /// Basic: 3×3. Bottleneck: 3×3 with the stride.
    pub conv2: Conv2d,
    /// After `conv2`.
    pub bn2: BatchNorm2d,
    /// Bottleneck only: 1×1 to four times the width.
    pub conv3: Option<Conv2d>,
    /// After `conv3`.
    pub bn3: Option<BatchNorm2d>,
    /// The shortcut's 1×1 convolution and batch norm, where the shape changes.
    pub downsample: Option<(Conv2d, BatchNorm2d)>,
}

impl ResidualBlock {
    fn new(
        depth: ResNetDepth,
        channels_in: usize,
        width: usize,
        stride: usize,
        rng: &mut WeightRng,
        device: &Device,
    ) -> Self {
        let channels_out = width * depth.expansion();
        let mut conv = |input: usize, output: usize, kernel: usize, stride: usize| {
            Conv2dConfig::before_batch_norm(input, output, kernel, stride).init(rng, device)
        };
        let (conv1, conv2, conv3) = if depth.is_bottleneck() {
            (
                conv(channels_in, width, 1, 1),
                conv(width, width, 3, stride),
                Some(conv(width, channels_out, 1, 1)),
            )
        } else {
            (
                conv(channels_in, width, 3, stride),
                conv(width, width, 3, 1),
                None,
            )
        };
        let downsample = (stride != 1 || channels_in != channels_out).then(|| {
            (
                conv(channels_in, channels_out, 1, stride),
                BatchNorm2d::new(channels_out, device),
            )
        });
        Self {
            conv1,
            bn1: BatchNorm2d::new(width, device),
            conv2,
            bn2: BatchNorm2d::new(width, device),
            bn3: conv3
                .is_some()
                .then(|| BatchNorm2d::new(channels_out, device)),
            conv3,
            downsample,
        }
    }

    /// y = relu(residual(x) + shortcut(x)).
    ///
    /// # Shapes
    /// - `x`: `[batch, in, height, width]`
    /// - output: `[batch, out, height / stride, width / stride]`
    pub fn forward(&self, x: Tensor<4>) -> Tensor<4> {
        let shortcut = match &self.downsample {
            Some((conv, bn)) => bn.forward(conv.forward(x.clone())),
            None => x.clone(),
        };
        let mut y = self.bn1.forward_relu(self.conv1.forward(x));
        y = self.conv2.forward(y);
        y = match (&self.conv3, &self.bn3) {
            (Some(conv3), Some(bn3)) => bn3.forward(conv3.forward(self.bn2.forward_relu(y))),
            _ => self.bn2.forward(y),
        };
        relu(y.add(shortcut))
    }
}
