//! The settings of DispNet as in SfMLearner (Zhou et al., CVPR 2017). The image is halved seven times and enlarged again. Each of the four
//! finest sizes has a disparity, which the next finer one reads.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::{ExpectedNetworkSetting as Expected, InputSize, NetworkError};

/// How many times the image is halved, and then enlarged.
pub const DISP_NET_LEVELS: usize = 7;

/// Sides of the kernels at each halving, in pixels.
pub const DISP_NET_KERNELS: [usize; DISP_NET_LEVELS] = [7, 5, 3, 3, 3, 3, 3];

/// Factor and summand of the disparity that the next scale reads: 10·σ + 0.01, as in the published networks, whatever the range of depths.
pub const DISP_NET_DISPARITY: [f64; 2] = [10.0, 0.01];

/// Number of disparities that the network predicts.
const SCALES: usize = 4;

/// What a `DispNet` is built from.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct DispNetConfig {
    /// Channels of the first layer, even; 32 in the published network.
    #[serde(default = "default_base_width")]
    pub base_width: usize,
}

fn default_base_width() -> usize {
    32
}

impl Default for DispNetConfig {
    fn default() -> Self {
        Self {
            base_width: default_base_width(),
        }
    }
}

impl DispNetConfig {
    /// # Errors
    /// [`NetworkError::Config`] for an invalid width.
    pub fn validate(&self) -> Result<(), NetworkError> {
        let width = self.base_width;
        if width.is_multiple_of(2) && (2..=256).contains(&width) {
            return Ok(());
        }
        Err(NetworkError::config(
            "disp_net.base_width",
            Expected::EvenUpTo(256),
            width,
        ))
    }

    /// Channels after each halving.
    #[must_use]
    pub fn widths(&self) -> [usize; DISP_NET_LEVELS] {
        [1, 2, 4, 8, 16, 16, 16].map(|factor| factor * self.base_width)
    }

    /// Channels after each enlargement, coarse to fine.
    #[must_use]
    pub fn decoder_widths(&self) -> [usize; DISP_NET_LEVELS] {
        [32, 32, 16, 8, 4, 2, 1].map(|factor| factor * self.base_width / 2)
    }

    /// Input channels of an enlargement.
    #[must_use]
    pub fn before(&self, stage: usize) -> usize {
        match stage {
            0 => self.widths()[DISP_NET_LEVELS - 1],
            _ => self.decoder_widths()[stage - 1],
        }
    }

    /// Channels appended to an enlargement's output: those of the halving with the same size, none at the image's own size.
    #[must_use]
    pub fn skip(&self, stage: usize) -> usize {
        let level = (DISP_NET_LEVELS - 2).checked_sub(stage);
        level.map_or(0, |level| self.widths()[level])
    }

    /// The scale of the disparity that an enlargement's layer outputs, 0 at the image's size; `None` for the coarse layers, which output
    /// none.
    #[must_use]
    pub fn scale_of(stage: usize) -> Option<usize> {
        (DISP_NET_LEVELS - 1)
            .checked_sub(stage)
            .filter(|scale| *scale < SCALES)
    }

    /// Whether an enlargement's layer reads the disparity of the previous scale.
    #[must_use]
    pub fn reads_disparity(stage: usize) -> bool {
        Self::scale_of(stage).is_some_and(|scale| scale + 1 < SCALES)
    }

    /// Pixels at 1/2^`halvings` of a size, rounded up.
    pub(super) fn pixels(size: InputSize, halvings: usize) -> usize {
        size.width.div_ceil(1 << halvings) * size.height.div_ceil(1 << halvings)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The number in the paper.
    #[test]
    fn stages_have_the_published_channels() {
        let config = DispNetConfig::default();
        assert_eq!(config.widths(), [32, 64, 128, 256, 512, 512, 512]);
        assert_eq!(config.decoder_widths(), [512, 512, 256, 128, 64, 32, 16]);
        let stages = 0..DISP_NET_LEVELS;
        let read: Vec<_> = stages
            .clone()
            .map(|s| {
                (
                    config.before(s),
                    config.skip(s),
                    DispNetConfig::reads_disparity(s),
                )
            })
            .collect();
        assert_eq!(read[0], (512, 512, false));
        assert_eq!(read[3], (256, 128, false));
        assert_eq!(read[4..], [(128, 64, true), (64, 32, true), (32, 0, true)]);
        let scales: Vec<_> = stages.filter_map(DispNetConfig::scale_of).collect();
        assert_eq!(scales, [3, 2, 1, 0]);
        for base_width in [0, 3, 1000] {
            assert!(DispNetConfig { base_width }.validate().is_err());
        }
    }
}
