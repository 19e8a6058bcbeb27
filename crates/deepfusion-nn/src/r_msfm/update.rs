use burn::module::Module;
use burn::tensor::{
    Device, Tensor,
    activation::{leaky_relu, softmax},
};

use super::features::{SLOPE, reflected};
use crate::R_MSFM_STATE;
use crate::init::WeightRng;
use crate::layers::{Conv2d, Conv2dConfig};

/// Pixels of the image along the side of a disparity pixel.
const SIDE: usize = 8;

/// One refinement. All convolutions are reflection-padded.
#[derive(Module, Debug)]
pub struct Update {
    /// 3×3 of the state, to 160 channels.
    pub state_1: Conv2d,
    /// 3×3 after `state_1`, to 128.
    pub state_2: Conv2d,
    /// 7×7 of the disparity's logit, to 64.
    pub disparity_1: Conv2d,
    /// 3×3 after `disparity_1`, to 32.
    pub disparity_2: Conv2d,
    /// 3×3 of state and disparity together, to 191; the logit is appended.
    pub join: Conv2d,
    /// 3×3 after `join`, to 256.
    pub change_1: Conv2d,
    /// 3×3 to the logit's change.
    pub change_2: Conv2d,
}

impl Update {
    pub(super) fn new(rng: &mut WeightRng, device: &Device) -> Self {
        let mut conv = |from, to, kernel| reflected([from, to], kernel, 1, rng, device);
        Self {
            state_1: conv(R_MSFM_STATE, 160, 3),
            state_2: conv(160, 128, 3),
            disparity_1: conv(1, 64, 7),
            disparity_2: conv(64, 32, 3),
            join: conv(160, 191, 3),
            change_1: conv(192, 256, 3),
            change_2: conv(256, 1, 3),
        }
    }

    /// The refined logit, and the feature that its change was computed from.
    ///
    /// # Shapes
    /// - `state`: `[batch, 128, height, width]`
    /// - `logit`: `[batch, 1, height, width]`
    /// - output: `[batch, 1, height, width]` and `[batch, 192, height, width]`
    pub fn forward(&self, state: Tensor<4>, logit: Tensor<4>) -> (Tensor<4>, Tensor<4>) {
        let layer = |conv: &Conv2d, x| leaky_relu(conv.forward(x), SLOPE);
        let state = layer(&self.state_2, layer(&self.state_1, state));
        let depth = layer(&self.disparity_2, layer(&self.disparity_1, logit.clone()));
        let joined = layer(&self.join, Tensor::cat(vec![state, depth], 1));
        let seen = Tensor::cat(vec![joined, logit.clone()], 1);
        let change = self.change_2.forward(layer(&self.change_1, seen.clone()));
        (logit.add(change), seen)
    }
}

/// RAFT's convex upsampling: each pixel of the image is a weighted mean of the 3×3 pixels around its place.
#[derive(Module, Debug)]
pub struct ConvexWeights {
    /// 3×3, to 324 channels, reflection-padded.
    pub reduce: Conv2d,
    /// 1×1, to the logarithms of nine weights for each of 64 pixels.
    pub expand: Conv2d,
}

impl ConvexWeights {
    pub(super) fn new(rng: &mut WeightRng, device: &Device) -> Self {
        Self {
            reduce: reflected([192, 324], 3, 1, rng, device),
            expand: Conv2dConfig::new(324, 9 * SIDE * SIDE, 1).init(rng, device),
        }
    }

    /// # Shapes
    /// - `small`: `[batch, 1, height, width]`
    /// - `seen`: `[batch, 192, height, width]`
    /// - output: `[batch, 1, 8·height, 8·width]`
    pub fn enlarged(&self, small: Tensor<4>, seen: Tensor<4>) -> Tensor<4> {
        let [batch, _, height, width] = small.dims();
        let reduced = leaky_relu(self.reduce.forward(seen), SLOPE);
        // The factor of a quarter balances the gradients.
        let logits = self.expand.forward(reduced).mul_scalar(0.25);
        let shares = softmax(logits.reshape([batch, 9, SIDE * SIDE, height, width]), 1);
        let around = neighbours(small).unsqueeze_dim::<5>(2);
        shares
            .mul(around)
            .sum_dim(1)
            .reshape([batch, SIDE, SIDE, height, width])
            .permute([0, 3, 1, 4, 2])
            .reshape([batch, 1, SIDE * height, SIDE * width])
    }
}

/// The 3×3 pixels around each pixel, row by row; zeros beyond the edge.
///
/// # Shapes
/// - `x`: `[batch, 1, height, width]`
/// - output: `[batch, 9, height, width]`
fn neighbours(x: Tensor<4>) -> Tensor<4> {
    let [batch, _, height, width] = x.dims();
    let device = x.device();
    let side = Tensor::zeros([batch, 1, height, 1], &device);
    let wide = Tensor::cat(vec![side.clone(), x, side], 3);
    let edge = Tensor::zeros([batch, 1, 1, width + 2], &device);
    let padded = Tensor::cat(vec![edge.clone(), wide, edge], 2);
    let tap = |i: usize| {
        padded
            .clone()
            .narrow(2, i / 3, height)
            .narrow(3, i % 3, width)
    };
    Tensor::cat((0..9).map(tap).collect(), 1)
}
