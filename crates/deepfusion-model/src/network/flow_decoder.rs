//! The settings of the optical-flow decoder on the depth network's encoder. Training only.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::{ExpectedNetworkSetting as Expected, NetworkError};

/// What a `FlowDecoder` is built from.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct FlowDecoderConfig {
    /// Largest residual displacement that a level searches along each axis, in its own pixels.
    pub radius: usize,
    /// Channels to which the encoder's features are projected before they are correlated.
    pub feature_width: usize,
    /// Channels of each level's 3×3 convolutions, in order.
    pub widths: Vec<usize>,
}

impl Default for FlowDecoderConfig {
    /// Radius 4 (81 displacements), 32 channels, widths 64, 48, 32.
    fn default() -> Self {
        Self {
            radius: 4,
            feature_width: 32,
            widths: vec![64, 48, 32],
        }
    }
}

impl FlowDecoderConfig {
    /// # Errors
    /// [`NetworkError::Config`] for a decoder that cannot be built.
    pub fn validate(&self) -> Result<(), NetworkError> {
        if !(1..=16).contains(&self.radius) {
            return Err(NetworkError::config(
                "flow_decoder.radius",
                Expected::UpTo(16),
                self.radius,
            ));
        }
        if !(1..=1024).contains(&self.feature_width) {
            let (field, found) = ("flow_decoder.feature_width", self.feature_width);
            return Err(NetworkError::config(field, Expected::UpTo(1024), found));
        }
        let fits = |width: &usize| (1..=4096).contains(width);
        if self.widths.is_empty() || !self.widths.iter().all(fits) {
            return Err(NetworkError::config(
                "flow_decoder.widths",
                Expected::OneWidth,
                &self.widths,
            ));
        }
        Ok(())
    }
}
