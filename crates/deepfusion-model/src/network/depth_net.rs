//! The settings of the depth network: an encoder, context and attention on its skip paths, the disparity decoder.

use deepfusion_geometry::DepthRange;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::{
    AttentionConfig, DecoderConfig, DispNetConfig, ExpectedNetworkSetting as Expected, HceConfig,
    InputNormalisation, LiteMonoConfig, LiteMonoSize, NetworkError, RMsfmConfig, ResNetConfig,
    ResNetDepth,
};

/// Limits of ln b, in training and in prediction. They correspond to errors of ln depth between 0.25 % and a factor of 7.
pub const LOG_SCALE_BOUNDS: (f64, f64) = (-6.0, 2.0);

/// Size of a network's input images, in pixels.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct InputSize {
    /// Width in pixels.
    pub width: usize,
    /// Height in pixels.
    pub height: usize,
}

impl InputSize {
    /// A valid input size.
    ///
    /// # Errors
    /// As for [`Self::validate`].
    pub fn new(width: usize, height: usize) -> Result<Self, NetworkError> {
        let size = Self { width, height };
        size.validate()?;
        Ok(size)
    }

    /// Checks that the encoder can halve the size five times and the decoder can pad: the coarsest feature has 1/32 of the size, and
    /// reflection padding needs two of its pixels in each direction.
    ///
    /// # Errors
    /// [`NetworkError::InputSize`] unless both sides are multiples of 32 and at least 64.
    pub fn validate(&self) -> Result<(), NetworkError> {
        let fits = |n: usize| n >= 64 && n.is_multiple_of(32);
        if fits(self.width) && fits(self.height) {
            Ok(())
        } else {
            Err(NetworkError::InputSize {
                width: self.width,
                height: self.height,
            })
        }
    }
}

/// One of the disparities that a depth network predicts in training.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct DepthScale {
    /// How many times the image's width and height are halved.
    pub halvings: u32,
    /// Weight of its reprojection error in the loss.
    pub weight: f64,
    /// Weight of its smoothness, which is multiplied by the loss's own weight.
    pub smoothness: f64,
}

/// What a `DepthNet` is built from.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct DepthNetConfig {
    /// The backbone. With `lite_mono`, `r_msfm` or `disp_net`, only its `normalisation` and `frozen_statistics` are used.
    pub encoder: ResNetConfig,
    /// Lite-Mono instead of the ResNet and its decoder; absent: those.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub lite_mono: Option<LiteMonoConfig>,
    /// R-MSFM instead of them; absent: those.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub r_msfm: Option<RMsfmConfig>,
    /// SfMLearner's DispNet instead of them; absent: those.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub disp_net: Option<DispNetConfig>,
    /// Hierarchical context encoding of the features of `layer1`…`layer4` on their way to the decoder;
    /// absent: the decoder reads the features as they are.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub hce: Option<HceConfig>,
    /// Attention on the output of the context encoding (or on the features themselves); absent: none.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub attention: Option<AttentionConfig>,
    /// Whether to project the mean of the coarsest feature over the image and add it to that feature.
    #[serde(default)]
    pub aggregation: bool,
    /// The decoder.
    #[serde(default)]
    pub decoder: DecoderConfig,
    /// Depths at the two ends of the sigmoid.
    #[serde(default)]
    pub range: DepthRange,
    /// Depth in metres that a new network predicts everywhere at first, by the heads' bias; absent: the bias is random. R-MSFM, even a
    /// trained one, refines from this depth; absent: from the middle of the range of disparities.
    ///
    /// With a bias near zero, the first depths are about 0.2 m, and a metric pose then projects every pixel out of view: nothing is left to
    /// learn from.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub initial_depth_m: Option<f64>,
    /// Whether an additional head predicts the uncertainty of each pixel.
    #[serde(default, skip_serializing_if = "std::ops::Not::not")]
    pub uncertainty: bool,
}

/// The beginning of the uncertainty head's tensor names in a depth network's weights.
pub const UNCERTAINTY_PREFIX: &str = "uncertainty.";

impl DepthNetConfig {
    /// A copy without the settings that do not change what the weights predict: whether batch norms learn, the uncertainty head, and the
    /// initial depth of new weights (unless R-MSFM refines from it).
    #[must_use]
    pub fn of_the_weights(&self) -> Self {
        let mut config = self.clone();
        config.uncertainty = false;
        config.encoder.frozen_statistics = false;
        if config.r_msfm.is_none() {
            config.initial_depth_m = None;
        }
        config
    }

    /// The published ResNet with the decoder's full widths, 0.1 to 90 m, starting at 10 m.
    #[must_use]
    pub fn new(depth: ResNetDepth) -> Self {
        Self {
            encoder: ResNetConfig::new(depth),
            lite_mono: None,
            r_msfm: None,
            disp_net: None,
            hce: None,
            attention: None,
            aggregation: false,
            decoder: DecoderConfig::default(),
            range: DepthRange::default(),
            initial_depth_m: Some(10.0),
            uncertainty: false,
        }
    }

    /// The paper's network (its Fig. 3): ResNet-50 at output stride 16, context encoding, attention and
    /// aggregation, 0.1 to 90 m, starting at 10 m.
    #[must_use]
    pub fn paper() -> Self {
        Self {
            encoder: ResNetConfig::new(ResNetDepth::ResNet50).with_output_stride(16),
            hce: Some(HceConfig::default()),
            attention: Some(AttentionConfig::default()),
            aggregation: true,
            ..Self::new(ResNetDepth::ResNet50)
        }
    }

    /// Monodepth2's network: its normalisation, its range of 0.1 to 100, random head biases.
    #[must_use]
    pub fn monodepth2(depth: ResNetDepth) -> Self {
        Self {
            encoder: ResNetConfig::new(depth).with_normalisation(InputNormalisation::Monodepth),
            range: DepthRange {
                min_m: 0.1,
                max_m: 100.0,
            },
            initial_depth_m: None,
            ..Self::new(depth)
        }
    }

    /// Lite-Mono: its normalisation, its range of 0.1 to 100, starting at 10 m.
    #[must_use]
    pub fn lite_mono(size: LiteMonoSize) -> Self {
        Self {
            lite_mono: Some(LiteMonoConfig::new(size)),
            initial_depth_m: Some(10.0),
            ..Self::monodepth2(ResNetDepth::ResNet18)
        }
    }

    /// R-MSFM: its normalisation, its range of 0.1 to 100, refining from 10 m.
    #[must_use]
    pub fn r_msfm(iterations: usize) -> Self {
        Self {
            r_msfm: Some(RMsfmConfig { iterations }),
            initial_depth_m: Some(10.0),
            ..Self::monodepth2(ResNetDepth::ResNet18)
        }
    }

    /// SfMLearner's DispNet: its normalisation, a range of 0.1 to 100, starting at 10 m.
    #[must_use]
    pub fn disp_net() -> Self {
        let encoder = ResNetConfig::new(ResNetDepth::ResNet18);
        Self {
            encoder: encoder.with_normalisation(InputNormalisation::Centred),
            disp_net: Some(DispNetConfig::default()),
            initial_depth_m: Some(10.0),
            ..Self::monodepth2(ResNetDepth::ResNet18)
        }
    }

    /// Whether the network is a ResNet with its decoder, so that other parts can read its features.
    #[must_use]
    pub fn is_resnet(&self) -> bool {
        self.lite_mono.is_none() && self.r_msfm.is_none() && self.disp_net.is_none()
    }

    /// The disparities that the network predicts in training, in the order of its outputs. A decoder's scales count equally, and their
    /// smoothness in proportion to their size. Each refinement counts nine tenths of the next; the last counts fully.
    #[must_use]
    pub fn scales(&self) -> Vec<DepthScale> {
        if let Some(r_msfm) = &self.r_msfm {
            let refinements = 0..r_msfm.iterations;
            let weight = |age: usize| 0.9_f64.powi(i32::try_from(age).unwrap_or(i32::MAX));
            return refinements
                .map(|age| DepthScale {
                    halvings: 0,
                    weight: weight(age),
                    smoothness: weight(age),
                })
                .collect();
        }
        let count = if self.lite_mono.is_some() { 3 } else { 4 };
        let weight = 1.0 / f64::from(count);
        (0..count)
            .map(|halvings| DepthScale {
                halvings,
                weight,
                smoothness: weight / f64::from(1_u32 << halvings),
            })
            .collect()
    }

    /// Lite-Mono, R-MSFM and DispNet have their own encoder and decoder, so settings of other parts would have no effect.
    fn validate_own_body(&self) -> Result<(), NetworkError> {
        let read = ResNetConfig {
            normalisation: self.encoder.normalisation,
            frozen_statistics: self.encoder.frozen_statistics,
            ..ResNetConfig::new(ResNetDepth::ResNet18)
        };
        let others = [
            ("encoder", self.encoder == read),
            ("hce", self.hce.is_none()),
            ("attention", self.attention.is_none()),
            ("aggregation", !self.aggregation),
            ("decoder", self.decoder == DecoderConfig::default()),
        ];
        match others.into_iter().find(|(_, is_default)| !is_default) {
            None => Ok(()),
            Some((field, _)) => Err(NetworkError::config(
                field,
                Expected::NotRead,
                format_args!("changed"),
            )),
        }
    }

    fn validate_r_msfm(&self, r_msfm: &RMsfmConfig) -> Result<(), NetworkError> {
        r_msfm.validate()?;
        let refused = |field, found: &str| {
            let expected = Expected::NotBesideRMsfm;
            Err(NetworkError::config(field, expected, found.to_owned()))
        };
        if self.lite_mono.is_some() {
            return refused("lite_mono", "another network");
        }
        if self.uncertainty {
            // R-MSFM's finest feature has an eighth of the image's size.
            return refused("uncertainty", "true");
        }
        Ok(())
    }

    fn validate_disp_net(&self, disp_net: &DispNetConfig) -> Result<(), NetworkError> {
        disp_net.validate()?;
        let others = [
            ("lite_mono", self.lite_mono.is_some()),
            ("r_msfm", self.r_msfm.is_some()),
        ];
        match others.into_iter().find(|(_, there)| *there) {
            None => Ok(()),
            Some((field, _)) => Err(NetworkError::config(
                field,
                Expected::NotBesideDispNet,
                "another network",
            )),
        }
    }

    /// # Errors
    /// [`NetworkError::Config`] for a network that cannot be built, or an invalid depth range.
    pub fn validate(&self) -> Result<(), NetworkError> {
        self.encoder.validate()?;
        self.hce.as_ref().map_or(Ok(()), HceConfig::validate)?;
        self.attention
            .as_ref()
            .map_or(Ok(()), AttentionConfig::validate)?;
        self.decoder.validate()?;
        self.lite_mono
            .as_ref()
            .map_or(Ok(()), LiteMonoConfig::validate)?;
        self.r_msfm
            .as_ref()
            .map_or(Ok(()), |r_msfm| self.validate_r_msfm(r_msfm))?;
        self.disp_net
            .as_ref()
            .map_or(Ok(()), |disp_net| self.validate_disp_net(disp_net))?;
        if !self.is_resnet() {
            self.validate_own_body()?;
        }
        if self.encoder.frames != 1 {
            return Err(NetworkError::config(
                "encoder.frames",
                Expected::OneImage,
                self.encoder.frames,
            ));
        }
        let DepthRange { min_m, max_m } = self.range;
        if !(min_m > 0.0 && max_m > min_m && max_m.is_finite()) {
            return Err(NetworkError::config(
                "range",
                Expected::DepthRange,
                self.range,
            ));
        }
        match self.initial_depth_m {
            Some(depth) if !(depth > min_m && depth < max_m) => Err(NetworkError::config(
                "initial_depth_m",
                Expected::InRange { min_m, max_m },
                depth,
            )),
            _ => Ok(()),
        }
    }

    /// Channels of the features that the decoder reads, fine to coarse.
    #[must_use]
    pub fn decoder_channels(&self) -> [usize; 5] {
        let mut channels = self.encoder.channels();
        if let Some(hce) = &self.hce {
            for channels in &mut channels[1..] {
                *channels = hce.width(*channels);
            }
        }
        channels
    }
}
