//! The settings of hierarchical context encoding (Eq. 11–12), which reads one feature at several scales.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::{ExpectedNetworkSetting as Expected, NetworkError};

/// What a `HierarchicalContext` is built from.
///
/// The paper's text gives the multi-scale factors 1, 3, 6 and 12, its Eq. 12 a 1×1 and 6, 12 and 18. The
/// default is a 1×1, 3, 6 and 12.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct HceConfig {
    /// Dilation of each 3×3 branch, which is its multi-scale factor.
    pub rates: Vec<usize>,
    /// Whether the mean over the image is also a branch.
    pub global_pool: bool,
    /// Whether the dilated branches read a 1×1 reduction to the branch width instead of the feature itself. Without it, four HCEs at a
    /// ResNet-50's widths cost more than the backbone.
    pub reduce_first: bool,
    /// How many times fewer channels a branch, and the output, has than the feature.
    pub width_divisor: usize,
    /// Smallest number of channels of a branch, and of the output.
    pub min_width: usize,
}

impl Default for HceConfig {
    /// 3, 6, 12 and the global mean, on a quarter of the channels but at least 32.
    fn default() -> Self {
        Self {
            rates: vec![3, 6, 12],
            global_pool: true,
            reduce_first: true,
            width_divisor: 4,
            min_width: 32,
        }
    }
}

impl HceConfig {
    /// Channels of a branch, and of the output, for a feature of `channels`.
    #[must_use]
    pub fn width(&self, channels: usize) -> usize {
        (channels / self.width_divisor.max(1)).max(self.min_width)
    }

    /// # Errors
    /// [`NetworkError::Config`] for invalid rates or widths.
    pub fn validate(&self) -> Result<(), NetworkError> {
        let in_range = |rate: &usize| (1..=64).contains(rate);
        if self.rates.len() > 8 || !self.rates.iter().all(in_range) {
            let found = &self.rates;
            return Err(NetworkError::config("hce.rates", Expected::Rates, found));
        }
        if !(1..=64).contains(&self.width_divisor) {
            let found = self.width_divisor;
            return Err(NetworkError::config(
                "hce.width_divisor",
                Expected::UpTo(64),
                found,
            ));
        }
        if !(1..=1024).contains(&self.min_width) {
            return Err(NetworkError::config(
                "hce.min_width",
                Expected::UpTo(1024),
                self.min_width,
            ));
        }
        Ok(())
    }
}
