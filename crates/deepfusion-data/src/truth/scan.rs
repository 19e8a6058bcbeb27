//! What a scan says of a frame: depth, velocities, dynamic pixels.

use deepfusion_geometry::DepthMap;
use deepfusion_hint::Hint;
use nalgebra::Vector3;

/// What a ground-truth depth means and at which pixel it lies.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum GtKind {
    /// Camera z at pixel round(u), round(v), as in KITTI's annotated depth.
    #[default]
    Z,
    /// The sensor's forward distance at pixel round(u) − 1, round(v) − 1: the field's `eigen` files,
    /// whose convention dates from a MATLAB devkit that counts pixels from 1. For published numbers.
    Velodyne,
    /// KITTI's annotated depth (`proj_depth/groundtruth` beside a drive's images): camera z, gathered from eleven scans, without what
    /// stereo contradicts. For the field's `eigen_benchmark`.
    Annotated,
}

impl GtKind {
    /// The name on the command line and in reports.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Z => "z",
            Self::Velodyne => "velodyne",
            Self::Annotated => "annotated",
        }
    }
}

/// A text that names no kind of ground-truth depth.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
#[error("'{text}' is no ground-truth depth: z, velodyne or annotated")]
pub struct NoSuchDepth {
    /// The text.
    pub text: String,
}

impl Hint for NoSuchDepth {
    /// The message itself lists the kinds.
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

/// Depth of a frame by its scan, and how fast what is seen there moves.
#[derive(Debug, Clone, PartialEq)]
pub struct ScanTruth {
    /// H×W camera z in metres, 0 = none; as [`crate::Dataset::ground_truth`].
    pub depth: DepthMap,
    /// Velocity over ground along the LiDAR's ray, m/s, receding is positive, row by row, of the point that the depth is
    /// of: about 0 for what stands still, NaN where there is no depth or no velocity. `None` where the scan has no
    /// radial velocities.
    pub velocity_mps: Option<Vec<f32>>,
}

/// The velocity of a LiDAR over ground, by its scan and by the vehicle.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct LidarMotion {
    /// When, in seconds on the frames' clock.
    pub time_s: f64,
    /// By the scan's static points, in the vehicle's axes (x forward, y left, z up), m/s.
    pub by_scan_mps: Vector3<f64>,
    /// By speed and yaw rate, same axes, m/s.
    pub by_vehicle_mps: Vector3<f64>,
}

/// How many points of some scans move by a topic of dynamic points, by their radial velocities, and by both.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct DynamicAgreement {
    /// Scans compared.
    pub scans: usize,
    /// Points that the topic lists.
    pub listed: usize,
    /// Of these, points of the scan: the same place, up to 1 cm.
    pub in_scan: usize,
    /// Points of the scans that move by their radial velocity.
    pub fast: usize,
    /// Points that move by both.
    pub both: usize,
}

impl DynamicAgreement {
    /// Share of the listed points that move by their radial velocity too; NaN where none is listed.
    #[must_use]
    pub fn precision(&self) -> f64 {
        self.both as f64 / self.listed as f64
    }

    /// Share of the points that move by their radial velocity that are listed too; NaN where none moves.
    #[must_use]
    pub fn recall(&self) -> f64 {
        self.both as f64 / self.fast as f64
    }
}
