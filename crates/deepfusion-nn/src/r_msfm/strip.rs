use burn::module::{Module, Param};
use burn::tensor::{Device, Tensor, TensorData};

use crate::init::WeightRng;
use crate::ops::{self, ConvOptions, Precision};

/// A convolution of 1×3 or 3×1 that keeps the size, with zero padding.
#[derive(Module, Debug)]
pub struct Strip {
    /// `[out, in, 1, 3]` or `[out, in, 3, 1]`.
    pub weight: Param<Tensor<4>>,
    /// `[out]`.
    pub bias: Param<Tensor<1>>,
}

impl Strip {
    /// A new layer along the rows or (`down`) along the columns, with PyTorch's default weights.
    pub(super) fn new(
        [channels_in, channels_out]: [usize; 2],
        down: bool,
        rng: &mut WeightRng,
        device: &Device,
    ) -> Self {
        let bound = 1.0 / ((3 * channels_in) as f32).sqrt();
        let weight = rng.uniform(3 * channels_out * channels_in, bound);
        let kernel = if down { [3, 1] } else { [1, 3] };
        let shape = [channels_out, channels_in, kernel[0], kernel[1]];
        let bias = rng.uniform(channels_out, bound);
        Self {
            weight: Param::from_data(TensorData::new(weight, shape), device),
            bias: Param::from_data(TensorData::new(bias, [channels_out]), device),
        }
    }

    /// # Shapes
    /// - `x`: `[batch, in, height, width]`
    /// - output: `[batch, out, height, width]`
    pub fn forward(&self, x: Tensor<4>) -> Tensor<4> {
        let options = ConvOptions {
            stride: 1,
            padding: 1,
            dilation: 1,
            reflect: false,
            precision: Precision::F32,
        };
        ops::conv2d(x, square(self.weight.val()), Some(self.bias.val()), options)
    }
}

/// The kernel as part of a 3×3 kernel with zeros beside it, since convolutions here have square kernels.
fn square(weight: Tensor<4>) -> Tensor<4> {
    let axis = if weight.dims()[2] == 1 { 2 } else { 3 };
    let beside = weight.zeros_like().narrow(axis, 0, 1).detach();
    Tensor::cat(vec![beside.clone(), weight, beside], axis)
}
