//! The settings of R-MSFM (Zhou et al., ICCV 2021): the first half of a ResNet-18, and a disparity that one small network refines
//! again and again, from the coarsest feature to the finest.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::{ExpectedNetworkSetting as Expected, InputSize, NetworkError};

/// Channels of what the features become before they refine the disparity, and of the gated unit's state.
pub const R_MSFM_STATE: usize = 128;

/// What a refinement of R-MSFM reads before it.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum RefinementInput {
    /// The middle feature, `layer1`'s.
    Middle,
    /// The finest, the stem's.
    Fine,
    /// The state itself, by the second refinement of this level: 0 is the coarsest.
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
    /// [`NetworkError::Config`] for another number of refinements than the published ones.
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

    /// Whether each feature refines twice.
    #[must_use]
    pub fn twice(&self) -> bool {
        self.iterations == 6
    }

    /// What is taken up into the state before refinement `index`, from 1 on: features from coarse to fine, each once or twice. The first
    /// refinement has the coarsest feature as its state.
    #[must_use]
    pub fn taken_up(&self, index: usize) -> RefinementInput {
        let times = if self.twice() { 2 } else { 1 };
        match (index % times, index / times) {
            (1, level) => RefinementInput::Again(level),
            (_, 1) => RefinementInput::Middle,
            _ => RefinementInput::Fine,
        }
    }

    /// Pixels of the refined disparity: an eighth of the image along each axis.
    pub(super) fn pixels(size: InputSize) -> usize {
        (size.width >> 3) * (size.height >> 3)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn features_are_taken_up_from_coarse_to_fine() {
        use RefinementInput::{Again, Fine, Middle};
        let all = |iterations: usize| -> Vec<RefinementInput> {
            let config = RMsfmConfig { iterations };
            (1..iterations).map(|i| config.taken_up(i)).collect()
        };
        assert_eq!(all(3), [Middle, Fine]);
        assert_eq!(all(6), [Again(0), Middle, Again(1), Fine, Again(2)]);
    }
}
