//! The settings of the disparity decoder.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::{ExpectedNetworkSetting as Expected, NetworkError};

/// What a `DisparityDecoder` is built from.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct DecoderConfig {
    /// Channels of the five stages, coarse to fine.
    pub widths: [usize; 5],
}

impl Default for DecoderConfig {
    /// 256, 128, 64, 32, 16.
    fn default() -> Self {
        Self {
            widths: [256, 128, 64, 32, 16],
        }
    }
}

impl DecoderConfig {
    /// # Errors
    /// [`NetworkError::Config`] for a stage without channels.
    pub fn validate(&self) -> Result<(), NetworkError> {
        if self.widths.iter().any(|width| !(1..=4096).contains(width)) {
            return Err(NetworkError::config(
                "decoder.widths",
                Expected::FiveWidths,
                self.widths,
            ));
        }
        Ok(())
    }
}
