//! The settings of R-MSFM (Zhou et al., ICCV 2021): the first half of a ResNet-18, and a small network that refines a disparity several
//! times, from the coarsest feature to the finest.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::{ExpectedNetworkSetting as Expected, InputSize, NetworkError};

/// Channels of the features that refine the disparity, and of the recurrent unit's state.
pub const R_MSFM_STATE: usize = 128;

/// What the state of R-MSFM is updated with before a refinement.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum RefinementInput {
    /// The middle feature, from `layer1`.
    Middle,
    /// The finest feature, from the stem.
    Fine,
    /// The state itself, before the second refinement at a level; 0 is the coarsest level.
    Again(usize),
}

/// What an `RMsfm` is built from.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct RMsfmConfig {
    /// How often the disparity is refined: 3 (R-MSFM3: once by each feature) or 6 (R-MSFM6: twice by each).
    pub iterations: usize,
}

impl RMsfmConfig {
    /// # Errors
    /// [`NetworkError::Config`] for a number of refinements other than the published ones.
    pub fn validate(&self) -> Result<(), NetworkError> {
        if matches!(self.iterations, 3 | 6) {
            return Ok(());
        }
        Err(NetworkError::config(
            "r_msfm.iterations",
            Expected::Either(3, 6),
            self.iterations,
        ))
    }

    /// Whether each feature refines the disparity twice.
    #[must_use]
    pub fn twice(&self) -> bool {
        self.iterations == 6
    }

    /// Input of the state's update before refinement `index`, which must be at least 1: features from coarse to fine, each once or twice.
    /// Refinement 0 starts with the coarsest feature as its state.
    #[must_use]
    pub fn refinement_input(&self, index: usize) -> RefinementInput {
        let times = if self.twice() { 2 } else { 1 };
        match (index % times, index / times) {
            (1, level) => RefinementInput::Again(level),
            (_, 1) => RefinementInput::Middle,
            _ => RefinementInput::Fine,
        }
    }

    /// Number of pixels of the refined disparity, which has an eighth of the image's size along each axis.
    pub(super) fn pixels(size: InputSize) -> usize {
        (size.width >> 3) * (size.height >> 3)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn features_are_read_from_coarse_to_fine() {
        use RefinementInput::{Again, Fine, Middle};
        let all = |iterations: usize| -> Vec<RefinementInput> {
            let config = RMsfmConfig { iterations };
            (1..iterations)
                .map(|i| config.refinement_input(i))
                .collect()
        };
        assert_eq!(all(3), [Middle, Fine]);
        assert_eq!(all(6), [Again(0), Middle, Again(1), Fine, Again(2)]);
    }
}
