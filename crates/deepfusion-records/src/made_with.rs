//! What else than its image an output depends on.

use deepfusion_eval::PostProcess;
use serde::{Deserialize, Serialize};

/// Program, weights and options: outputs of the same image with equal ones are equal (on one machine; the last digits
/// depend on the processor).
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct MadeWith {
    /// The program's version.
    pub version: String,
    /// SHA-256 of the network's configuration and weights.
    pub weights: String,
    /// What ran the network, and on which device.
    pub engine: String,
    /// The outputs' kinds.
    pub save: Vec<String>,
    /// How far clouds reach, metres.
    pub max_depth_m: f64,
    /// Largest standard deviation of a cloud's points, as a share of their depth.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub max_sigma: Option<f64>,
    /// fx, fy, cx, cy that were given for all images.
    pub intrinsics: Option<[f64; 4]>,
    /// The field of view from left to right that was given for all images, in degrees.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub hfov_deg: Option<f64>,
    /// SHA-256 of a calibration tool's file.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub calibration_sha256: Option<String>,
    /// Whether depth is corrected for another focal length than the one trained with.
    pub focal_correction: bool,
    /// Whether images are stretched to the network's aspect ratio, not cut.
    pub stretch: bool,
    /// Whether the scale monitor brings depth back to the metres that were learned.
    #[serde(default, skip_serializing_if = "std::ops::Not::not")]
    pub correct_scale: bool,
    /// In how many ways the network looked at each image; absent: in one.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub post_process: Option<PostProcess>,
    /// The data set, of those that the network learned from, whose metres are meant.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub set: Option<String>,
    /// The topics that were named for bags: `image=/left`.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub topics: Vec<String>,
    /// The camera's height above the road that was given, metres, where depth is brought back by it.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub camera_height_m: Option<f64>,
}

/// In what two [`MadeWith`] differ.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[non_exhaustive]
pub enum Difference {
    /// The program's version.
    Version,
    /// The network.
    Weights,
    /// What ran it.
    Engine,
    /// The outputs' kinds.
    Save,
    /// The data set whose metres are meant.
    Set,
    /// How far clouds reach.
    MaxDepth,
    /// How sure the points of clouds must be.
    MaxSigma,
    /// The camera that was given.
    Camera,
    /// The correction for the focal length.
    FocalCorrection,
    /// Whether images are stretched.
    Stretch,
    /// Whether the scale is corrected.
    CorrectScale,
    /// In how many ways the network looked.
    PostProcess,
    /// The topics that bags are read by.
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
    /// The first thing that differs.
    #[must_use]
    pub fn difference(&self, other: &Self) -> Option<Difference> {
        let camera =
            !self.same_camera(other) || self.calibration_sha256 != other.calibration_sha256;
        [
            (self.version != other.version, Difference::Version),
            (self.weights != other.weights, Difference::Weights),
            (self.engine != other.engine, Difference::Engine),
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

/// Whether two numbers are the same but for the last digits, which JSON may lose.
#[must_use]
pub fn same_number(a: f64, b: f64) -> bool {
    (a - b).abs() <= 1e-12 * a.abs()
}
