//! Steps that a device decides about, without the host waiting for the outcome.

use super::corrections::corrections;
use burn::tensor::{Bool, Device, Int, Tensor, TensorData};

/// Most steps that may be begun on a device before the host reads which of them were made.
pub(crate) const MOST_UNDECIDED: usize = 10;

/// Steps of which the host does not know whether they were made.
#[derive(Debug, Clone)]
pub(super) struct Undecided {
    /// 1 − β₁ᵗ and 1 − β₂ᵗ of the steps to come, `[MOST_UNDECIDED, 2]`. The host computes them, so that a step is the same whether host or
    /// device decides about it.
    corrections: Tensor<2>,
    /// How many of the begun steps were made, `[1]`.
    made: Tensor<1, Int>,
    begun: usize,
}

impl Undecided {
    /// No step begun yet, after `steps` steps made.
    pub(super) fn after(steps: u32, device: &Device) -> Self {
        let next = (steps + 1..).take(MOST_UNDECIDED);
        let values: Vec<f32> = next.flat_map(corrections).collect();
        Self {
            corrections: Tensor::from_data(TensorData::new(values, [MOST_UNDECIDED, 2]), device),
            made: Tensor::from_data([0_i64], device),
            begun: 0,
        }
    }

    /// Begins a step, which is counted if `is_made`, `[1]`. Returns its corrections, `[2]`.
    pub(super) fn begin(&mut self, is_made: &Tensor<1, Bool>) -> Tensor<1> {
        debug_assert!(
            self.begun < MOST_UNDECIDED,
            "the outcomes of earlier steps must be read first"
        );
        self.begun += 1;
        let own = self.corrections.clone().select(0, self.made.clone());
        self.made = self.made.clone() + is_made.clone().int();
        own.reshape([2])
    }
}
