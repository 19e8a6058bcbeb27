//! Adam's bias correction: the moments start at zero.

/// Decay of the first moment.
pub(super) const BETA1: f64 = 0.9;
/// Decay of the second moment.
pub(super) const BETA2: f64 = 0.999;

/// 1 − β₁ᵗ and 1 − β₂ᵗ of the t-th step.
pub(super) fn corrections(step: u32) -> [f32; 2] {
    [BETA1, BETA2].map(|beta| (1.0 - beta.powi(step as i32)) as f32)
}
