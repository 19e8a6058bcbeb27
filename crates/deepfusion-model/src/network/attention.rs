//! The settings of channel and spatial attention (Eq. 13–15).

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::{ExpectedNetworkSetting as Expected, NetworkError};

/// How the masks act on the feature.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum AttentionForm {
    /// F' = F ⊙ M_s ⊙ M_c, the paper's Eq. 15. Untrained masks are ½ each, so the feature starts at a quarter.
    #[default]
    Product,
    /// F' = F ⊙ (1 + M_s ⊙ M_c): the feature always passes.
    Residual,
}

/// What an `Attention` is built from.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct AttentionConfig {
    /// How the masks act on the feature.
    pub form: AttentionForm,
    /// How many times fewer channels the channel mask's hidden layer has than the feature (rounded up).
    pub reduction: usize,
    /// Side of the spatial mask's kernel in pixels; odd.
    pub kernel: usize,
}

impl Default for AttentionConfig {
    /// The plain product, a reduction by 16, 7×7.
    fn default() -> Self {
        Self {
            form: AttentionForm::default(),
            reduction: 16,
            kernel: 7,
        }
    }
}

impl AttentionConfig {
    /// Channels of the channel mask's hidden layer.
    #[must_use]
    pub fn hidden(&self, channels: usize) -> usize {
        channels.div_ceil(self.reduction.max(1))
    }

    /// # Errors
    /// [`NetworkError::Config`] for an invalid reduction or kernel.
    pub fn validate(&self) -> Result<(), NetworkError> {
        if !(1..=1024).contains(&self.reduction) {
            let found = self.reduction;
            return Err(NetworkError::config(
                "attention.reduction",
                Expected::UpTo(1024),
                found,
            ));
        }
        if self.kernel.is_multiple_of(2) || self.kernel > 15 {
            let found = self.kernel;
            return Err(NetworkError::config(
                "attention.kernel",
                Expected::OddUpTo(15),
                found,
            ));
        }
        Ok(())
    }
}
