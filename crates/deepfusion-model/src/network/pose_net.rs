//! The settings of the pose network: the motion between two frames.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::{
    ExpectedNetworkSetting as Expected, InputNormalisation, NetworkError, ResNetConfig, ResNetDepth,
};

/// Channels between the layers of the pose decoder.
pub const POSE_WIDTH: usize = 256;

/// Channels of the layers of the explainability masks, coarse to fine.
pub const EXPLAINABILITY_WIDTHS: [usize; 5] = [256, 128, 64, 32, 16];

/// What a `PoseNet` is built from.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct PoseNetConfig {
    /// The backbone, on two frames.
    pub encoder: ResNetConfig,
    /// Number of poses that the last convolution outputs (six channels each); the first is used.
    #[serde(default = "one_pose")]
    pub poses: usize,
    /// Metres of translation per unit of the raw output. The data's mean displacement per pair
    /// keeps the raw output near one.
    #[serde(default = "one_metre")]
    pub metres_per_unit: f64,
    /// Whether PoseNet also predicts, pixel by pixel, how far a warp between the two frames can explain them (SfMLearner's explainability
    /// masks). `loss.explainability` then holds the masks up.
    #[serde(default, skip_serializing_if = "std::ops::Not::not")]
    pub explainability: bool,
}

fn one_pose() -> usize {
    1
}

fn one_metre() -> f64 {
    1.0
}

impl PoseNetConfig {
    /// The published ResNet on two frames, one pose, one metre per unit.
    #[must_use]
    pub fn new(depth: ResNetDepth) -> Self {
        Self {
            encoder: ResNetConfig::new(depth).with_frames(2),
            poses: one_pose(),
            metres_per_unit: one_metre(),
            explainability: false,
        }
    }

    /// Monodepth2's network: its normalisation, twelve outputs of which the first six are used,
    /// translation × 0.01 (in units of its own: its scale is not metric).
    #[must_use]
    pub fn monodepth2(depth: ResNetDepth) -> Self {
        Self {
            encoder: ResNetConfig::new(depth)
                .with_frames(2)
                .with_normalisation(InputNormalisation::Monodepth),
            poses: 2,
            metres_per_unit: 0.01,
            explainability: false,
        }
    }

    /// # Errors
    /// [`NetworkError::Config`] for a network that cannot be built, or a factor that is not positive.
    pub fn validate(&self) -> Result<(), NetworkError> {
        self.validate_layers()?;
        if !(self.metres_per_unit > 0.0 && self.metres_per_unit.is_finite()) {
            return Err(NetworkError::config(
                "pose_net.metres_per_unit",
                Expected::Metres,
                self.metres_per_unit,
            ));
        }
        Ok(())
    }

    /// Like [`Self::validate`], but without checking `metres_per_unit`, which may still have to be measured.
    ///
    /// # Errors
    /// [`NetworkError::Config`].
    pub fn validate_layers(&self) -> Result<(), NetworkError> {
        self.encoder.validate()?;
        // PoseNet always reads a pair of frames.
        if self.encoder.frames != 2 {
            return Err(NetworkError::config(
                "pose_net.encoder.frames",
                Expected::Pair,
                self.encoder.frames,
            ));
        }
        if self.explainability && self.encoder.is_dilated() {
            return Err(NetworkError::config(
                "pose_net.encoder.output_stride",
                Expected::StrideOfMasks,
                self.encoder.output_stride,
            ));
        }
        if !(1..=16).contains(&self.poses) {
            return Err(NetworkError::config(
                "pose_net.poses",
                Expected::UpTo(16),
                self.poses,
            ));
        }
        Ok(())
    }
}
