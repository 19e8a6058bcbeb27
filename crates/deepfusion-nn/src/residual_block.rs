//! The residual blocks of a ResNet's layers.

use burn::module::Module;
use burn::tensor::{Device, Tensor};

use crate::ResNetDepth;
use crate::init::WeightRng;
use crate::layers::{BatchNorm2d, Conv2d, Conv2dConfig};
use crate::ops;

/// Configuration of a block.
#[derive(Debug, Clone, Copy)]
pub(crate) struct BlockConfig {
    pub(crate) depth: ResNetDepth,
    pub(crate) channels_in: usize,
    /// Channels of the 3×3 convolutions.
    pub(crate) width: usize,
    pub(crate) stride: usize,
    /// Dilation of the 3×3 convolutions: one in a bottleneck, both in a basic block.
    pub(crate) dilation: usize,
}

/// One residual block: basic (two 3×3 convolutions), or bottleneck (1×1, 3×3, 1×1) if `conv3` is present. As in torchvision, the 3×3
/// convolution of a bottleneck has the stride.
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
    /// The shortcut's 1×1 convolution and batch norm, if the shape changes.
    pub downsample: Option<(Conv2d, BatchNorm2d)>,
}

impl ResidualBlock {
    pub(crate) fn new(config: BlockConfig, rng: &mut WeightRng, device: &Device) -> Self {
        let BlockConfig {
            depth,
            channels_in,
            width,
            stride,
            dilation,
        } = config;
        let channels_out = width * depth.expansion();
        let mut conv = |input: usize, output: usize, kernel: usize, stride: usize| {
            let conv = Conv2dConfig::before_batch_norm(input, output, kernel, stride);
            conv.dilated(dilation).init(rng, device)
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
        ops::add_relu(y, shortcut)
    }
}
