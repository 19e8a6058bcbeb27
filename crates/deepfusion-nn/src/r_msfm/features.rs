use burn::module::Module;
use burn::tensor::{Device, Tensor, activation::leaky_relu};

use super::strip::Strip;
use crate::init::WeightRng;
use crate::layers::{Conv2d, Conv2dConfig};
use crate::{R_MSFM_STATE, RefinementInput};

/// Slope of every leaky ReLU below 0.
pub(super) const SLOPE: f64 = 0.01;

/// A reflection-padded convolution.
pub(super) fn reflected(
    channels: [usize; 2],
    kernel: usize,
    stride: usize,
    rng: &mut WeightRng,
    device: &Device,
) -> Conv2d {
    let mut config = Conv2dConfig::new(channels[0], channels[1], kernel).reflected();
    config.options.stride = stride;
    config.init(rng, device)
}

/// Computes the input of R-MSFM6's second refinement at a level from the state x: tanh(3×1(tanh(1×3(x)))).
#[derive(Module, Debug)]
pub struct Context {
    /// 1×3.
    pub across: Strip,
    /// 3×1.
    pub down: Strip,
}

impl Context {
    fn new(rng: &mut WeightRng, device: &Device) -> Self {
        let channels = [R_MSFM_STATE; 2];
        Self {
            across: Strip::new(channels, false, rng, device),
            down: Strip::new(channels, true, rng, device),
        }
    }

    /// # Shapes
    /// - `x`, output: `[batch, 128, height, width]`
    pub fn forward(&self, x: Tensor<4>) -> Tensor<4> {
        self.down.forward(self.across.forward(x).tanh()).tanh()
    }
}

/// Brings the encoder's features to one size and the state's number of channels.
#[derive(Module, Debug)]
pub struct Features {
    /// For the coarsest feature: 3×3.
    pub coarse: Conv2d,
    /// For the middle feature: 3×3 at stride 2.
    pub middle: Conv2d,
    /// For the finest feature: 3×3 at stride 2, to 96 channels.
    pub fine_reduce: Conv2d,
    /// After `fine_reduce`: 3×3 at stride 2.
    pub fine: Conv2d,
    /// The inputs of R-MSFM6's second refinements, one for each feature from the coarsest to the finest; empty in R-MSFM3.
    pub context: Vec<Context>,
}

impl Features {
    pub(super) fn new(twice: bool, rng: &mut WeightRng, device: &Device) -> Self {
        let state = R_MSFM_STATE;
        Self {
            fine_reduce: reflected([64, 96], 3, 2, rng, device),
            fine: reflected([96, state], 3, 2, rng, device),
            middle: reflected([64, state], 3, 2, rng, device),
            coarse: reflected([128, state], 3, 1, rng, device),
            context: (0..if twice { 3 } else { 0 })
                .map(|_| Context::new(rng, device))
                .collect(),
        }
    }

    /// The initial state.
    pub(super) fn first(&self, features: &[Tensor<4>; 3]) -> Tensor<4> {
        self.coarse.forward(features[2].clone()).tanh()
    }

    /// The input of a refinement.
    pub(super) fn next(
        &self,
        input: RefinementInput,
        features: &[Tensor<4>; 3],
        state: Tensor<4>,
    ) -> Tensor<4> {
        match input {
            RefinementInput::Again(level) => self.context[level].forward(state),
            RefinementInput::Middle => self.middle.forward(features[1].clone()).tanh(),
            RefinementInput::Fine => {
                let x = leaky_relu(self.fine_reduce.forward(features[0].clone()), SLOPE);
                self.fine.forward(x).tanh()
            }
        }
    }
}
