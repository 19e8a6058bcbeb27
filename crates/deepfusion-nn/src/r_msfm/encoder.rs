use burn::module::Module;
use burn::tensor::{Device, Tensor};

use crate::init::WeightRng;
use crate::layers::{BatchNorm2d, Conv2d, Conv2dConfig};
use crate::ops::max_pool_3x3_stride_2;
use crate::residual_block::ResidualBlock;
use crate::resnet::{layer, normalised, run};
use crate::{InputNormalisation, ResNetConfig, ResNetDepth};

/// ResNet-18 up to its second layer, under torchvision's names.
#[derive(Module, Debug)]
pub struct HalfResNet {
    /// 7×7 at stride 2.
    pub conv1: Conv2d,
    /// After `conv1`.
    pub bn1: BatchNorm2d,
    /// Stride 4.
    pub layer1: Vec<ResidualBlock>,
    /// Stride 8.
    pub layer2: Vec<ResidualBlock>,
    #[module(skip)]
    normalisation: InputNormalisation,
}

impl HalfResNet {
    /// A new encoder with torchvision's initialisation.
    pub(super) fn new(
        normalisation: InputNormalisation,
        rng: &mut WeightRng,
        device: &Device,
    ) -> Self {
        let config = ResNetConfig::new(ResNetDepth::ResNet18);
        let conv1 = Conv2dConfig::before_batch_norm(3, config.base_width, 7, 2).init(rng, device);
        let mut layer = |index| layer(&config, index, rng, device);
        Self {
            conv1,
            bn1: BatchNorm2d::new(config.base_width, device),
            layer1: layer(0),
            layer2: layer(1),
            normalisation,
        }
    }

    /// # Shapes
    /// - `images`: `[batch, 3, height, width]`, RGB in [0, 1]
    /// - output: 64, 64 and 128 channels at 1/2, 1/4 and 1/8 of the images' size
    pub fn forward(&self, images: Tensor<4>) -> [Tensor<4>; 3] {
        let x = normalised(self.normalisation, images);
        let f0 = self.bn1.forward_relu(self.conv1.forward(x));
        let f1 = run(&self.layer1, max_pool_3x3_stride_2(f0.clone()));
        let f2 = run(&self.layer2, f1.clone());
        [f0, f1, f2]
    }
}
