//! The settings of R-MSFM (Zhou et al., ICCV 2021): the first half of a ResNet-18, and a disparity that one small network refines
//! again and again, from the coarsest feature to the finest.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::{InputSize, NetworkError};

/// Channels of what the features become before they refine the disparity, and of the gated unit's state.
pub const R_MSFM_STATE: usize = 128;

/// What an `RMsfm` is built from.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct RMsfmConfig {
    /// How often the disparity is refined: 3 (R-MSFM3: once by each feature) or 6 (R-MSFM6: twice).
    pub iterations: usize,
}

impl RMsfmConfig {
    /// # Errors
    /// [`NetworkError::Config`] for another number of refinements than the published ones.
    pub fn validate(&self) -> Result<(), NetworkError> {
        if matches!(self.iterations, 3 | 6) {
            return Ok(());
        }
        Err(NetworkError::config(
            "r_msfm.iterations",
            "3 or 6",
            self.iterations,
        ))
    }

    /// Whether each feature refines twice.
    #[must_use]
    pub fn twice(&self) -> bool {
        self.iterations == 6
    }

    /// Pixels of the refined disparity: an eighth of the image along each axis.
    pub(super) fn pixels(size: InputSize) -> usize {
        (size.width >> 3) * (size.height >> 3)
    }
}
