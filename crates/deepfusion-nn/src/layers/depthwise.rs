use burn::module::{Module, Param};
use burn::tensor::{Device, Tensor, TensorData};

use crate::init::WeightRng;
use crate::ops;

/// A depthwise convolution at stride 1 that keeps the size, zero-padded and without bias: every channel has a kernel of its own.
#[derive(Module, Debug)]
pub struct DepthwiseConv2d {
    /// `[channels, 1, kernel, kernel]`.
    pub weight: Param<Tensor<4>>,
    #[module(skip)]
    dilation: usize,
}

impl DepthwiseConv2d {
    /// A new layer with an odd `kernel` side. Its weights are normal with variance 2 / (channels · kernel²), since PyTorch counts the
    /// fan-out of a depthwise kernel like this.
    #[must_use]
    pub fn new(
        channels: usize,
        kernel: usize,
        dilation: usize,
        rng: &mut WeightRng,
        device: &Device,
    ) -> Self {
        let count = channels * kernel * kernel;
        let weight = rng.normal(count, (2.0 / count as f32).sqrt());
        let shape = [channels, 1, kernel, kernel];
        Self {
            weight: Param::from_data(TensorData::new(weight, shape), device),
            dilation,
        }
    }

    /// # Shapes
    /// - `x`, output: `[batch, channels, height, width]`
    pub fn forward(&self, x: Tensor<4>) -> Tensor<4> {
        ops::depthwise(x, self.weight.val(), self.dilation)
    }
}
