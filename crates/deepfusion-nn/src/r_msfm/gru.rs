use burn::module::Module;
use burn::tensor::{Device, Tensor};

use super::strip::Strip;
use crate::R_MSFM_STATE;
use crate::init::WeightRng;
use crate::ops::sigmoid;

/// A gated recurrent unit of 1×3 or 3×1 convolutions.
#[derive(Module, Debug)]
pub struct GatedUnit {
    /// z: the weight of the candidate.
    pub update: Strip,
    /// r: the weight of the state in the candidate.
    pub reset: Strip,
    /// q: the candidate.
    pub candidate: Strip,
}

impl GatedUnit {
    fn new(down: bool, rng: &mut WeightRng, device: &Device) -> Self {
        let mut strip = || Strip::new([2 * R_MSFM_STATE, R_MSFM_STATE], down, rng, device);
        Self {
            update: strip(),
            reset: strip(),
            candidate: strip(),
        }
    }

    /// h ← (1 − z) ⊙ h + z ⊙ q, z = σ(u ⋆ [h, x]), r = σ(v ⋆ [h, x]), q = tanh(w ⋆ [r ⊙ h, x]).
    ///
    /// # Shapes
    /// - `state`, `x`, output: `[batch, 128, height, width]`
    pub fn forward(&self, state: Tensor<4>, x: Tensor<4>) -> Tensor<4> {
        let both = Tensor::cat(vec![state.clone(), x.clone()], 1);
        let share = sigmoid(self.update.forward(both.clone()));
        let kept = sigmoid(self.reset.forward(both)).mul(state.clone());
        let candidate = self.candidate.forward(Tensor::cat(vec![kept, x], 1)).tanh();
        state.clone().add(share.mul(candidate.sub(state)))
    }
}

/// Two gated units, first along the rows, then along the columns.
#[derive(Module, Debug)]
pub struct SeparableGru {
    /// 1×3.
    pub across: GatedUnit,
    /// 3×1.
    pub down: GatedUnit,
}

impl SeparableGru {
    pub(super) fn new(rng: &mut WeightRng, device: &Device) -> Self {
        Self {
            across: GatedUnit::new(false, rng, device),
            down: GatedUnit::new(true, rng, device),
        }
    }

    /// # Shapes
    /// As [`GatedUnit::forward`].
    pub fn forward(&self, state: Tensor<4>, x: Tensor<4>) -> Tensor<4> {
        self.down.forward(self.across.forward(state, x.clone()), x)
    }
}
