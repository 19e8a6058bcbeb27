//! ResNet encoders in torchvision's layout and with its parameter names.

use burn::module::Module;
use burn::tensor::{Device, Tensor};

use crate::init::WeightRng;
use crate::layers::{BatchNorm2d, Conv2d, Conv2dConfig, freeze_statistics};
use crate::ops::max_pool_3x3_stride_2;
use crate::residual_block::{BlockConfig, ResidualBlock};
use crate::{Error, InputNormalisation, ResNetConfig};

/// A ResNet without its classifier. The fields have torchvision's names, so that a tensor's path, such as `layer1.0.conv1.weight`, is its
/// name in torchvision's files.
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
    /// A new encoder with torchvision's initialisation.
    ///
    /// # Errors
    /// As [`ResNetConfig::validate`].
    pub fn new(config: &ResNetConfig, rng: &mut WeightRng, device: &Device) -> Result<Self, Error> {
        config.validate()?;
        let conv1 = Conv2dConfig::before_batch_norm(3 * config.frames, config.base_width, 7, 2)
            .init(rng, device);
        let mut layer = |index| layer(config, index, rng, device);
        let resnet = ResNet {
            conv1,
            bn1: BatchNorm2d::new(config.base_width, device),
            layer1: layer(0),
            layer2: layer(1),
            layer3: layer(2),
            layer4: layer(3),
            normalisation: config.normalisation,
        };
        Ok(freeze_statistics(resnet, config.frozen_statistics))
    }

    /// f₀ = relu(bn₁(conv₁(x))), f₁ = layer₁(maxpool(f₀)), fₖ = layerₖ(fₖ₋₁) (Eq. 10).
    ///
    /// # Shapes
    /// - `images`: `[batch, 3·frames, height, width]`, RGB in [0, 1]
    /// - output: five features `[batch, channels[k], height / 2ᵏ⁺¹, width / 2ᵏ⁺¹]`, k = 0…4; at output stride 16 the last one has the size
    ///   of the one before
    pub fn forward(&self, images: Tensor<4>) -> [Tensor<4>; 5] {
        let x = normalised(self.normalisation, images);
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

/// The blocks of one of the layers 1 to 4, which are counted from 0.
pub(crate) fn layer(
    config: &ResNetConfig,
    index: usize,
    rng: &mut WeightRng,
    device: &Device,
) -> Vec<ResidualBlock> {
    let width = config.base_width << index;
    let mut channels_in = config.channels()[index];
    (0..config.depth.blocks()[index])
        .map(|block| {
            let [stride, dilation] = config.steps(index, block);
            let config = BlockConfig {
                depth: config.depth,
                channels_in,
                width,
                stride,
                dilation,
            };
            channels_in = width * config.depth.expansion();
            ResidualBlock::new(config, rng, device)
        })
        .collect()
}

pub(crate) fn run(layer: &[ResidualBlock], x: Tensor<4>) -> Tensor<4> {
    layer.iter().fold(x, |x, block| block.forward(x))
}

/// (x − mean) / std of the three channels, the same for each frame.
///
/// # Shapes
/// - `images`, output: `[batch, 3·frames, height, width]`
pub(crate) fn normalised(normalisation: InputNormalisation, images: Tensor<4>) -> Tensor<4> {
    let channels = images.dims()[1];
    let device = images.device();
    let per_channel = |values: [f32; 3]| {
        let repeated: Vec<f32> = values.into_iter().cycle().take(channels).collect();
        Tensor::<1>::from_floats(repeated.as_slice(), &device).reshape([1, channels, 1, 1])
    };
    images
        .sub(per_channel(normalisation.mean()))
        .div(per_channel(normalisation.std()))
}
