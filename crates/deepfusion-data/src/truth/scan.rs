//! Ground truth of a frame from a scan: depth, velocities, dynamic pixels.

use deepfusion_geometry::DepthMap;
use deepfusion_hint::Hint;
use nalgebra::Vector3;

/// Kind of ground-truth depth: its definition, and the pixel at which it is stored.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum GtKind {
    /// Camera z at pixel round(u), round(v), as in KITTI's annotated depth.
    #[default]
    Z,
    /// The sensor's forward distance at pixel round(u) − 1, round(v) − 1, as in the published `eigen` files,
    /// whose convention comes from a MATLAB devkit that counts pixels from 1. For comparison with published numbers.
    Velodyne,
    /// KITTI's annotated depth (`proj_depth/groundtruth` beside a drive's images): camera z, accumulated from eleven scans, without points
    /// that stereo contradicts. For the published split `eigen_benchmark`.
    Annotated,
}

impl GtKind {
    /// The kind's name on the command line and in reports.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Z => "z",
            Self::Velodyne => "velodyne",
            Self::Annotated => "annotated",
        }
    }
}

/// The error for a text that does not name a kind of ground-truth depth.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
#[error("unknown ground-truth depth '{text}', expected z, velodyne or annotated")]
pub struct NoSuchDepth {
    /// The text given.
    pub text: String,
}

impl Hint for NoSuchDepth {
    /// No hint: the message already lists the kinds.
    fn hint(&self) -> Option<String> {
        None
    }
}

impl std::str::FromStr for GtKind {
    type Err = NoSuchDepth;

    fn from_str(text: &str) -> Result<Self, NoSuchDepth> {
        match text {
            "z" => Ok(Self::Z),
            "velodyne" => Ok(Self::Velodyne),
            "annotated" => Ok(Self::Annotated),
            _ => Err(NoSuchDepth {
                text: text.to_owned(),
            }),
        }
    }
}

/// Depth of a frame from its scan, with the velocities at its pixels.
#[derive(Debug, Clone, PartialEq)]
pub struct ScanTruth {
    /// H×W camera z in metres, 0 = no depth; the same as [`crate::Dataset::ground_truth`].
    pub depth: DepthMap,
    /// Velocity over ground along the LiDAR's ray of the point at each pixel, m/s, receding is positive, row by row: about 0
    /// for static points, NaN for pixels without depth or velocity. `None` if the scan has no radial
    /// velocities.
    pub velocity_mps: Option<Vec<f32>>,
}

/// The velocity of a LiDAR over ground, according to its scan and to the vehicle.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct LidarMotion {
    /// Time of the scan, in seconds on the frames' clock.
    pub time_s: f64,
    /// Velocity from the scan's static points, in the vehicle's axes (x forward, y left, z up), m/s.
    pub by_scan_mps: Vector3<f64>,
    /// Velocity from speed and yaw rate, in the same axes, m/s.
    pub by_vehicle_mps: Vector3<f64>,
}

/// Numbers of points in some scans that are dynamic according to a topic of dynamic points, to their radial velocities, and to both.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct DynamicAgreement {
    /// Number of scans compared.
    pub scans: usize,
    /// Number of points listed in the topic.
    pub listed: usize,
    /// Number of these that match a point of the scan within 1 cm.
    pub in_scan: usize,
    /// Number of points in the scans that are dynamic according to their radial velocity.
    pub fast: usize,
    /// Number of points that are dynamic according to both.
    pub both: usize,
}

impl DynamicAgreement {
    /// Fraction of the listed points that are also dynamic according to their radial velocity; NaN if none is listed.
    #[must_use]
    pub fn precision(&self) -> f64 {
        self.both as f64 / self.listed as f64
    }

    /// Fraction of the points that are dynamic according to their radial velocity that are also listed; NaN if there are none.
    #[must_use]
    pub fn recall(&self) -> f64 {
        self.both as f64 / self.fast as f64
    }
}
