use burn::module::{Module, Param};
use burn::tensor::{Device, Tensor, TensorData};

use crate::init::WeightRng;
use crate::ops::{self, ConvOptions, Precision};

/// A transposed convolution of 3×3 and stride 2 (PyTorch's with padding 1 and output padding 1). The output has twice the image's size, or
/// is cropped.
///
/// Along each axis out(2i) = w₁·x(i) and out(2i + 1) = w₂·x(i) + w₀·x(i + 1), zeros beyond the edge: a convolution of 2×2 to four times the
/// channels, which become the four pixels of a block.
#[derive(Module, Debug)]
pub struct TransposedConv2d {
    /// `[in, out, 3, 3]`, as in PyTorch.
    pub weight: Param<Tensor<4>>,
    /// `[out]`.
    pub bias: Param<Tensor<1>>,
}

impl TransposedConv2d {
    /// A new layer with Xavier's weights and a bias of 0.
    pub(super) fn new(
        [channels_in, channels_out]: [usize; 2],
        rng: &mut WeightRng,
        device: &Device,
    ) -> Self {
        let weight = rng.xavier(channels_in * channels_out, 9, channels_in + channels_out);
        let weight = TensorData::new(weight, [channels_in, channels_out, 3, 3]);
        let bias = TensorData::new(vec![0.0_f32; channels_out], [channels_out]);
        Self {
            weight: Param::from_data(weight, device),
            bias: Param::from_data(bias, device),
        }
    }

    /// # Shapes
    /// - `x`: `[batch, in, h, w]`
    /// - output: `[batch, out, height, width]`, height 2·h or 2·h − 1, width the same
    pub fn forward(&self, x: Tensor<4>, [height, width]: [usize; 2]) -> Tensor<4> {
        let [batch, _, h, w] = x.dims();
        let [_, channels, _, _] = self.weight.dims();
        let own = self.weight.val().swap_dims(0, 1);
        let halves = |weight: &Tensor<4>, axis| [even(weight, axis), odd(weight, axis)];
        let rows = halves(&own, 2);
        let blocks = rows.iter().flat_map(|row| halves(row, 3)).collect();
        let bias = self.bias.val();
        let options = ConvOptions {
            stride: 1,
            padding: 1,
            dilation: 1,
            reflect: false,
            precision: Precision::F32,
        };
        let bias = Tensor::cat(vec![bias; 4], 0);
        // Padding is needed on one side, but applied on both: the surplus row and column are cropped with the rest.
        let wide = ops::conv2d(x, Tensor::cat(blocks, 0), Some(bias), options);
        wide.reshape([batch, 2, 2, channels, h + 1, w + 1])
            .permute([0, 3, 4, 1, 5, 2])
            .reshape([batch, channels, 2 * h + 2, 2 * w + 2])
            .narrow(2, 2, height)
            .narrow(3, 2, width)
    }
}

/// The taps of even output pixels: w₁ on the pixel itself.
fn even(weight: &Tensor<4>, axis: usize) -> Tensor<4> {
    let tap = weight.clone().narrow(axis, 1, 1);
    let none = tap.zeros_like().detach();
    Tensor::cat(vec![tap, none], axis)
}

/// The taps of odd output pixels: w₂ on the pixel itself and w₀ on the next.
fn odd(weight: &Tensor<4>, axis: usize) -> Tensor<4> {
    let tap = |index| weight.clone().narrow(axis, index, 1);
    Tensor::cat(vec![tap(2), tap(0)], axis)
}
