//! The settings of Lite-Mono (Zhang et al., CVPR 2023, arXiv 2211.13202): a light encoder of dilated convolutions and
//! cross-covariance attention, and a decoder of three scales.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::{ExpectedNetworkSetting as Expected, NetworkError};

/// ε of Lite-Mono's layer normalisations.
pub const LAYER_NORM_EPSILON: f64 = 1e-6;

/// Channels of the positional encoding, for each axis.
pub const POSITION_CHANNELS: usize = 32;

/// Which of the published networks.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum LiteMonoSize {
    /// Lite-Mono: 3.1 M parameters.
    Full,
    /// Lite-Mono-small: 2.5 M.
    Small,
    /// Lite-Mono-tiny: 2.2 M.
    Tiny,
    /// Lite-Mono-8M: 8.7 M.
    EightM,
}

impl LiteMonoSize {
    /// All published networks.
    pub const ALL: [Self; 4] = [Self::Full, Self::Small, Self::Tiny, Self::EightM];
}

/// What a `LiteMono` is built from.
///
/// Three stages, at 1/4, 1/8 and 1/16 of the image's size. Each is a row of dilated depthwise convolutions (CDC) and then one block
/// of attention between channels (LGFI). The decoder's stages have half the channels.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct LiteMonoConfig {
    /// Channels of the three stages, fine to coarse.
    pub widths: [usize; 3],
    /// Dilations of each stage's convolutions, in order. Published: 1, 2, 3 (in the last stage once or twice, then 2, 4, 6) for 640×192;
    /// for 1024×320, all but Lite-Mono-8M have 5 and 10 instead of 3 and 6.
    pub dilations: [Vec<usize>; 3],
    /// Number of attention heads: groups of channels that attend to each other.
    #[serde(default = "eight")]
    pub heads: usize,
    /// How many times more channels a block has than its stage.
    #[serde(default = "six")]
    pub expansion: usize,
}

fn eight() -> usize {
    8
}

fn six() -> usize {
    6
}

impl LiteMonoConfig {
    /// The published network for images of 640×192.
    #[must_use]
    pub fn new(size: LiteMonoSize) -> Self {
        let widths = match size {
            LiteMonoSize::Full | LiteMonoSize::Small => [48, 80, 128],
            LiteMonoSize::Tiny => [32, 64, 128],
            LiteMonoSize::EightM => [64, 128, 224],
        };
        let last: &[usize] = match size {
            LiteMonoSize::Full | LiteMonoSize::EightM => &[1, 2, 3, 1, 2, 3, 2, 4, 6],
            LiteMonoSize::Small | LiteMonoSize::Tiny => &[1, 2, 3, 2, 4, 6],
        };
        Self {
            widths,
            dilations: [vec![1, 2, 3], vec![1, 2, 3], last.to_vec()],
            heads: eight(),
            expansion: six(),
        }
    }

    /// The published network for images of 1024×320, which differs in its dilations.
    #[must_use]
    pub fn for_large_images(mut self) -> Self {
        if self.widths == Self::new(LiteMonoSize::EightM).widths {
            return self;
        }
        for rate in self.dilations.iter_mut().flatten() {
            *rate = match *rate {
                3 => 5,
                6 => 10,
                other => other,
            };
        }
        self
    }

    /// Channels of the decoder's stages, fine to coarse.
    #[must_use]
    pub fn decoder_widths(&self) -> [usize; 3] {
        self.widths.map(|width| width / 2)
    }

    /// # Errors
    /// [`NetworkError::Config`] for invalid widths, dilations or heads.
    pub fn validate(&self) -> Result<(), NetworkError> {
        if !(1..=64).contains(&self.heads) {
            return Err(NetworkError::config(
                "lite_mono.heads",
                Expected::UpTo(64),
                self.heads,
            ));
        }
        let whole = |w: &usize| {
            (2..=2048).contains(w) && w.is_multiple_of(2) && w.is_multiple_of(self.heads)
        };
        if !self.widths.iter().all(whole) {
            return Err(NetworkError::config(
                "lite_mono.widths",
                Expected::WidthsOfHeads { heads: self.heads },
                self.widths,
            ));
        }
        let in_range = |rate: &usize| (1..=64).contains(rate);
        let fits = |rates: &Vec<usize>| rates.len() <= 64 && rates.iter().all(in_range);
        if !self.dilations.iter().all(fits) {
            return Err(NetworkError::config(
                "lite_mono.dilations",
                Expected::RatesOfStages,
                &self.dilations,
            ));
        }
        if !(1..=16).contains(&self.expansion) {
            return Err(NetworkError::config(
                "lite_mono.expansion",
                Expected::UpTo(16),
                self.expansion,
            ));
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_published_networks_are_valid_and_survive_their_file() {
        for size in LiteMonoSize::ALL {
            for config in [
                LiteMonoConfig::new(size),
                LiteMonoConfig::new(size).for_large_images(),
            ] {
                config.validate().unwrap();
                let text = toml::to_string(&config).unwrap();
                assert_eq!(toml::from_str::<LiteMonoConfig>(&text).unwrap(), config);
            }
        }
        let large = LiteMonoConfig::new(LiteMonoSize::Small).for_large_images();
        assert_eq!(large.dilations[2], [1, 2, 5, 2, 4, 10]);
        let eight = LiteMonoConfig::new(LiteMonoSize::EightM);
        assert_eq!(eight.clone().for_large_images(), eight);
    }

    #[test]
    fn invalid_settings_are_refused_by_field() {
        let field = |change: fn(&mut LiteMonoConfig)| {
            let mut config = LiteMonoConfig::new(LiteMonoSize::Full);
            change(&mut config);
            match config.validate() {
                Err(NetworkError::Config { field, .. }) => field,
                other => panic!("{other:?}"),
            }
        };
        assert_eq!(field(|c| c.heads = 0), "lite_mono.heads");
        assert_eq!(field(|c| c.heads = 7), "lite_mono.widths");
        assert_eq!(field(|c| c.widths[1] = 0), "lite_mono.widths");
        assert_eq!(field(|c| c.dilations[2][0] = 0), "lite_mono.dilations");
        assert_eq!(field(|c| c.expansion = 0), "lite_mono.expansion");
    }
}
