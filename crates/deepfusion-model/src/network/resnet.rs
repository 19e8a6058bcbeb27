//! The settings of the encoders: ResNets in torchvision's layout.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::{ExpectedNetworkSetting as Expected, NetworkError};

/// ε of every batch normalisation, PyTorch's default.
pub const BATCH_NORM_EPSILON: f64 = 1e-5;

/// Which of the published ResNets.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
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
    /// All published ResNets.
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

/// How images in [0, 1] are normalised for an encoder's first convolution.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum InputNormalisation {
    /// (x − mean) / std per channel, with ImageNet's statistics.
    ImageNet,
    /// (x − 0.45) / 0.225 on every channel.
    Monodepth,
    /// (x − 0.5) / 0.5 on every channel, as in SfMLearner.
    Centred,
}

impl InputNormalisation {
    /// Mean of red, green and blue.
    #[must_use]
    pub fn mean(self) -> [f32; 3] {
        match self {
            Self::ImageNet => [0.485, 0.456, 0.406],
            Self::Monodepth => [0.45; 3],
            Self::Centred => [0.5; 3],
        }
    }

    /// Standard deviation of red, green and blue.
    #[must_use]
    pub fn std(self) -> [f32; 3] {
        match self {
            Self::ImageNet => [0.229, 0.224, 0.225],
            Self::Monodepth => [0.225; 3],
            Self::Centred => [0.5; 3],
        }
    }
}

/// What a `ResNet` is built from.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct ResNetConfig {
    /// Layout of the ResNet.
    pub depth: ResNetDepth,
    /// Channels of the first convolution: 64 in the published network; fewer make a narrower network, which torchvision's weights do not
    /// fit.
    #[serde(default = "default_base_width")]
    pub base_width: usize,
    /// Number of images stacked along the channels: 1, or 2 for a pose network.
    #[serde(default = "default_frames")]
    pub frames: usize,
    /// Normalisation of the input.
    #[serde(default = "default_normalisation")]
    pub normalisation: InputNormalisation,
    /// Whether batch norms keep their running statistics in training. This is for batches too small to have statistics of their own, and
    /// needs imported weights. In a depth network it applies to all batch norms, the context encoding's included.
    #[serde(default)]
    pub frozen_statistics: bool,
    /// How many times smaller the coarsest feature is than the image: 32 or 16. At 16, `layer4` keeps a stride of 1 and its 3×3
    /// convolutions are dilated instead, by 2 × `multi_grid` (DeepLabv3); its weights are the same.
    #[serde(default = "default_output_stride")]
    pub output_stride: usize,
    /// Dilations of `layer4`'s blocks divided by 2, at output stride 16; cut to the number of blocks.
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

    /// The same network on `frames` images stacked along the channels.
    #[must_use]
    pub fn with_frames(mut self, frames: usize) -> Self {
        self.frames = frames;
        self
    }

    /// The same network with another base width.
    #[must_use]
    pub fn with_base_width(mut self, base_width: usize) -> Self {
        self.base_width = base_width;
        self
    }

    /// The same network with another input normalisation.
    #[must_use]
    pub fn with_normalisation(mut self, normalisation: InputNormalisation) -> Self {
        self.normalisation = normalisation;
        self
    }

    /// The same network with another output stride.
    #[must_use]
    pub fn with_output_stride(mut self, output_stride: usize) -> Self {
        self.output_stride = output_stride;
        self
    }

    /// Whether `layer4` is dilated instead of halving the image.
    #[must_use]
    pub fn is_dilated(&self) -> bool {
        self.output_stride == 16
    }

    /// Stride and dilation of a block of `layer1`…`layer4` (0…3).
    pub fn steps(&self, layer: usize, block: usize) -> [usize; 2] {
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
    /// [`NetworkError::Config`] for an invalid width, number of frames, output stride or dilation.
    pub fn validate(&self) -> Result<(), NetworkError> {
        if !(1..=1024).contains(&self.base_width) {
            return Err(NetworkError::config(
                "encoder.base_width",
                Expected::UpTo(1024),
                self.base_width,
            ));
        }
        if !(1..=16).contains(&self.frames) {
            return Err(NetworkError::config(
                "encoder.frames",
                Expected::UpTo(16),
                self.frames,
            ));
        }
        if !matches!(self.output_stride, 16 | 32) {
            let found = self.output_stride;
            return Err(NetworkError::config(
                "encoder.output_stride",
                Expected::Either(16, 32),
                found,
            ));
        }
        if self.multi_grid.iter().any(|rate| !(1..=16).contains(rate)) {
            let found = self.multi_grid;
            return Err(NetworkError::config(
                "encoder.multi_grid",
                Expected::MultiGrid,
                found,
            ));
        }
        Ok(())
    }
}
