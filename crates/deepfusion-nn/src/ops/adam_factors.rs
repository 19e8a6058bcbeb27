//! The factors of a step of Adam as a tensor.

use burn::tensor::{Bool, Device, Tensor};
use deepfusion_kernels::AdamStep;

/// The factors of a step of Adam that may be known only on the device: the gradient's factor, 1 − β₁ᵗ, 1 − β₂ᵗ, and whether the step is
/// made (1) or nothing changes (0). Four numbers in one tensor, so that the host need not read them.
#[derive(Debug, Clone)]
pub struct AdamFactors(Tensor<1>);

impl AdamFactors {
    /// The factors in `step`, for a step that is made.
    #[must_use]
    pub fn of(step: &AdamStep, device: &Device) -> Self {
        let factors = [
            step.gradient_scale,
            step.correction1,
            step.correction2,
            1.0_f32,
        ];
        Self(Tensor::from_data(factors, device))
    }

    /// Factors that were computed on the device.
    ///
    /// # Shapes
    /// - `gradient_scale`, `is_made`: `[1]`
    /// - `corrections`: `[2]`
    #[must_use]
    pub fn decided(
        gradient_scale: Tensor<1>,
        corrections: Tensor<1>,
        is_made: Tensor<1, Bool>,
    ) -> Self {
        let factors = vec![gradient_scale, corrections, is_made.float()];
        Self(Tensor::cat(factors, 0))
    }

    /// All four factors in one tensor, `[4]`.
    #[cfg(feature = "gpu")]
    pub(super) fn together(&self) -> Tensor<1> {
        self.0.clone()
    }

    /// Each factor as a tensor of its own, `[1]`.
    pub(super) fn each(&self) -> [Tensor<1>; 4] {
        std::array::from_fn(|place| self.0.clone().narrow(0, place, 1))
    }
}
