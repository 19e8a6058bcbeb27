//! What an output depends on besides its image.

use deepfusion_eval::PostProcess;
use serde::{Deserialize, Serialize};

/// Program, weights and options: if they are equal, outputs of the same image are equal (on one machine; the last digits depend on the
/// processor).
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct MadeWith {
    /// The program's version.
    pub version: String,
    /// SHA-256 of the network's configuration and weights.
    pub weights: String,
    /// The engine that ran the network, and its device.
    pub engine: String,
    /// The kinds of outputs.
    pub save: Vec<String>,
    /// Largest depth of the points in clouds, in metres.
    pub max_depth_m: f64,
    /// Largest standard deviation of a cloud's points, as a share of their depth.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub max_sigma: Option<f64>,
    /// fx, fy, cx, cy in pixels, if given for all images.
    pub intrinsics: Option<[f64; 4]>,
    /// The horizontal field of view in degrees, if given for all images.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub hfov_deg: Option<f64>,
    /// SHA-256 of a calibration tool's file.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub calibration_sha256: Option<String>,
    /// Whether depth is corrected for a focal length other than the one trained with.
    pub focal_correction: bool,
    /// Whether images are stretched to the network's aspect ratio rather than cropped.
    pub stretch: bool,
    /// Whether depth is corrected by the scale monitor.
    #[serde(default, skip_serializing_if = "std::ops::Not::not")]
    pub correct_scale: bool,
    /// Of which predictions of an image the mean is taken (test-time augmentation); absent: only one prediction.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub post_process: Option<PostProcess>,
    /// The training data set whose metric scale is used, if there were several.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub set: Option<String>,
    /// The topics chosen for bags: `image=/left`.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub topics: Vec<String>,
    /// The given height of the camera above the road in metres, if depth is corrected by it.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub camera_height_m: Option<f64>,
}

/// A setting in which two [`MadeWith`] differ.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[non_exhaustive]
pub enum Difference {
    /// The program's version.
    Version,
    /// The network.
    Weights,
    /// The engine or its device.
    Engine,
    /// The kinds of outputs.
    Save,
    /// The training data set whose metric scale is used.
    Set,
    /// Largest depth of the points in clouds.
    MaxDepth,
    /// Largest standard deviation of the points in clouds.
    MaxSigma,
    /// The given camera.
    Camera,
    /// The focal correction.
    FocalCorrection,
    /// Whether images are stretched.
    Stretch,
    /// Whether the scale is corrected.
    CorrectScale,
    /// The test-time augmentation.
    PostProcess,
    /// The topics chosen for bags.
    Topics,
}

impl std::fmt::Display for Difference {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(match self {
            Self::Version => "another program version",
            Self::Weights => "other weights",
            Self::Engine => "another engine",
            Self::Save => "other outputs",
            Self::Set => "another data set's metres",
            Self::MaxDepth => "another largest depth",
            Self::MaxSigma => "another largest standard deviation",
            Self::Camera => "another camera",
            Self::FocalCorrection => "another correction for the focal length",
            Self::Stretch => "another way of fitting images to the network",
            Self::Topics => "other topics",
            Self::CorrectScale => "another correction of the scale",
            Self::PostProcess => "another post-processing",
        })
    }
}

impl MadeWith {
    /// The first setting that differs.
    #[must_use]
    pub fn difference(&self, other: &Self) -> Option<Difference> {
        let camera =
            !self.same_camera(other) || self.calibration_sha256 != other.calibration_sha256;
        [
            (self.version != other.version, Difference::Version),
            // First: the weights of an int8 network include its calibration.
            (self.engine != other.engine, Difference::Engine),
            (self.weights != other.weights, Difference::Weights),
            (self.save != other.save, Difference::Save),
            (self.set != other.set, Difference::Set),
            (
                !same_number(self.max_depth_m, other.max_depth_m),
                Difference::MaxDepth,
            ),
            (self.max_sigma != other.max_sigma, Difference::MaxSigma),
            (camera, Difference::Camera),
            (
                self.focal_correction != other.focal_correction,
                Difference::FocalCorrection,
            ),
            (self.stretch != other.stretch, Difference::Stretch),
            (
                self.correct_scale != other.correct_scale
                    || self.camera_height_m != other.camera_height_m,
                Difference::CorrectScale,
            ),
            (
                self.post_process != other.post_process,
                Difference::PostProcess,
            ),
            (self.topics != other.topics, Difference::Topics),
        ]
        .into_iter()
        .find_map(|(differs, what)| differs.then_some(what))
    }

    fn same_camera(&self, other: &Self) -> bool {
        match (self.intrinsics, other.intrinsics) {
            (Some(a), Some(b)) => a.iter().zip(b).all(|(a, b)| same_number(*a, b)),
            (a, b) => {
                let views = (self.hfov_deg, other.hfov_deg);
                a.is_none()
                    && b.is_none()
                    && match views {
                        (Some(a), Some(b)) => same_number(a, b),
                        (a, b) => a.is_none() && b.is_none(),
                    }
            }
        }
    }
}

/// Whether two numbers are equal except for the last digits, which JSON may lose.
#[must_use]
pub fn same_number(a: f64, b: f64) -> bool {
    (a - b).abs() <= 1e-12 * a.abs()
}
