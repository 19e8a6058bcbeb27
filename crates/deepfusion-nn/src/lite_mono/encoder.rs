use burn::module::Module;
use burn::tensor::{Device, Tensor, module::avg_pool2d, ops::AvgPoolOptions};

use super::{DilatedBlock, GlobalBlock};
use crate::init::WeightRng;
use crate::layers::{BatchNorm2d, Conv2d, Conv2dConfig, ConvNorm};
use crate::resnet::normalised;
use crate::{InputNormalisation, LiteMonoConfig, ops};

/// The blocks of one stage, which have the same size.
#[derive(Module, Debug)]
pub struct LiteMonoStage {
    /// Dilated blocks, one after the other.
    pub dilated: Vec<DilatedBlock>,
    /// The global block after them.
    pub global: GlobalBlock,
}

impl LiteMonoStage {
    /// # Shapes
    /// - `x`, output: `[batch, channels, height, width]`
    pub fn forward(&self, x: Tensor<4>) -> Tensor<4> {
        let x = self.dilated.iter().fold(x, |x, block| block.forward(x));
        self.global.forward(x)
    }
}

/// Lite-Mono's encoder.
#[derive(Module, Debug)]
pub struct LiteMonoEncoder {
    /// Three 3×3 with batch normalisation and GELU, the first at stride 2.
    pub stem: Vec<ConvNorm>,
    /// The 3×3 at stride 2 before each stage. It reads the last result, the input of the stage before (from the second stage on), and the
    /// image at the same size.
    pub reduce: Vec<Conv2d>,
    /// The stages, at 1/4, 1/8 and 1/16 of the image's size.
    pub stages: Vec<LiteMonoStage>,
    #[module(skip)]
    normalisation: InputNormalisation,
}

impl LiteMonoEncoder {
    /// A new encoder of a valid configuration.
    pub(super) fn new(
        config: &LiteMonoConfig,
        normalisation: InputNormalisation,
        rng: &mut WeightRng,
        device: &Device,
    ) -> Self {
        let [first, ..] = config.widths;
        let stem = [(3, 2), (first, 1), (first, 1)].map(|(from, stride)| ConvNorm {
            conv: Conv2dConfig::before_batch_norm(from, first, 3, stride).init(rng, device),
            bn: BatchNorm2d::new(first, device),
        });
        let mut from = first + 3;
        let (mut reduce, mut stages) = (Vec::new(), Vec::new());
        for (stage, width) in config.widths.into_iter().enumerate() {
            let conv = Conv2dConfig::before_batch_norm(from, width, 3, 2);
            reduce.push(conv.init(rng, device));
            let dilated = config.dilations[stage].iter();
            let dilated = dilated
                .map(|rate| DilatedBlock::new(width, *rate, config.expansion, rng, device))
                .collect();
            let sizes = [config.heads, config.expansion];
            let global = GlobalBlock::new(width, sizes, stage == 0, rng, device);
            stages.push(LiteMonoStage { dilated, global });
            from = 2 * width + 3;
        }
        Self {
            stem: stem.into(),
            reduce,
            stages,
            normalisation,
        }
    }

    /// # Shapes
    /// - `images`: `[batch, 3, height, width]`, RGB in [0, 1]
    /// - output: three features `[batch, widths[k], height / 2ᵏ⁺², width / 2ᵏ⁺²]`, k = 0…2
    pub fn forward(&self, images: Tensor<4>) -> Vec<Tensor<4>> {
        let mut image = normalised(self.normalisation, images);
        let mut x = image.clone();
        for layer in &self.stem {
            x = ops::gelu(layer.bn.forward(layer.conv.forward(x)));
        }
        let mut read = vec![x];
        let mut features = Vec::new();
        for (reduce, stage) in self.reduce.iter().zip(&self.stages) {
            image = halved(image);
            read.push(image.clone());
            let start = reduce.forward(Tensor::cat(read, 1));
            let feature = stage.forward(start.clone());
            features.push(feature.clone());
            read = vec![start, feature];
        }
        features
    }
}

/// The mean over 3×3 pixels at stride 2; the zeros of a border of one pixel count.
fn halved(image: Tensor<4>) -> Tensor<4> {
    let options = AvgPoolOptions::new([3, 3])
        .with_stride([2, 2])
        .with_padding([1, 1]);
    avg_pool2d(image, options)
}
