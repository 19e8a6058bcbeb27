//! The contents of a recording, as printed by `data inspect`.

use super::kind::DatasetKind;
use super::warning::DataWarning;
use crate::Error;
use deepfusion_geometry::Intrinsics;
use serde::{Serialize, Serializer};
use std::fmt::Display;
use std::path::{Path, PathBuf};
use std::sync::Arc;

/// The report of `data inspect`, for one or several drives.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Inspection {
    /// The layout.
    pub kind: DatasetKind,
    /// Number of images of the camera, over all drives.
    pub frames: usize,
    /// Width and height of the images, in pixels; `None` (JSON `null`) without images.
    pub size: Option<[u32; 2]>,
    /// Their intrinsics, after correction of the lens distortion.
    pub intrinsics: Option<IntrinsicsSummary>,
    /// The recorded streams; with several drives, their names start with the drive.
    pub streams: Vec<Stream>,
    /// Speeds at the frames; `None` (JSON `null`) if unknown.
    pub speed_mps: Option<SpeedRange>,
    /// Distance driven between the first and last frames, in metres, without gaps.
    pub distance_m: Option<f64>,
    /// Time from the first to the last frames, in seconds.
    pub duration_s: Option<f64>,
    /// The individual drives.
    pub drives: Vec<DriveInspection>,
    /// Those of several recordings that cannot be read; the values above do not include them. Absent from JSON if empty.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub unreadable: Vec<Unreadable>,
}

/// One of several recordings that cannot be read.
#[derive(Debug, Clone, Serialize)]
pub struct Unreadable {
    /// Path of its file or folder.
    #[serde(serialize_with = "path_text")]
    pub path: PathBuf,
    /// Why it cannot be read; in JSON the error's message.
    #[serde(serialize_with = "text")]
    pub error: Arc<Error>,
}

/// Errors are equal if their messages are.
impl PartialEq for Unreadable {
    fn eq(&self, other: &Self) -> bool {
        let key = |one: &Self| (one.path.clone(), one.error.to_string());
        key(self) == key(other)
    }
}

fn path_text<S: Serializer>(path: &Path, serializer: S) -> Result<S::Ok, S::Error> {
    text(&path.display(), serializer)
}

fn text<S: Serializer>(value: &impl Display, serializer: S) -> Result<S::Ok, S::Error> {
    serializer.collect_str(value)
}

fn texts<S: Serializer>(warnings: &[DataWarning], serializer: S) -> Result<S::Ok, S::Error> {
    serializer.collect_seq(warnings.iter().map(ToString::to_string))
}

/// One drive of an [`Inspection`].
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct DriveInspection {
    /// The drive's name.
    pub name: String,
    /// The inspected camera: 2, or 3 if no drive has images of 2. Layouts other than KITTI's have a single one, which counts as 2.
    pub camera: u8,
    /// Number of its images.
    pub frames: usize,
    /// Numbers missing between its first and last image, as ranges `[from, to]`.
    pub missing_frames: Vec<[u64; 2]>,
    /// Number of pairs of neighbouring frames that can be used for training at 0.5 m/s or more.
    pub usable_pairs: usize,
    /// Why there are no usable pairs; `None` if there are some.
    pub why_no_pairs: Option<String>,
    /// Number of frames with ground truth: a LiDAR scan or a depth image.
    pub scans: usize,
    /// Speeds at the frames.
    pub speed_mps: Option<SpeedRange>,
    /// Distance driven, in metres.
    pub distance_m: Option<f64>,
    /// Sum of the changes of heading, in radians, positive to the left; `None` if no yaw rate was recorded.
    pub turn_rad: Option<f64>,
    /// Time from the first to the last frame, in seconds.
    pub duration_s: Option<f64>,
    /// How far the camera's clock is ahead of the vehicle's, in seconds, according to the recording's file or the caller; already
    /// subtracted from the images' times.
    pub camera_ahead_s: f64,
    /// The remaining offset of the vehicle's clock from the camera's, measured from the motion in the images. `None` if it was not
    /// measured ([`crate::inspect_with`]), the drive does not show it, or there are several drives.
    pub time_offset: Option<ClockOffset>,
    /// A bag's sensor mounts, with their sources.
    pub mounts: Vec<Mount>,
    /// Assumptions and oddities; in JSON `remarks`, as sentences.
    #[serde(rename = "remarks", serialize_with = "texts")]
    pub warnings: Vec<DataWarning>,
}

/// A sensor's mount, in the form of the file beside a bag.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Mount {
    /// Name of the transform: `cam_from_vehicle`, `cam_from_lidar`, `vehicle_from_imu`. Camera axes are x right, y down, z forward; the
    /// other frames' axes are x forward, y left, z up.
    pub name: &'static str,
    /// Where the mount comes from.
    pub source: String,
    /// Translation, in metres.
    pub translation: [f64; 3],
    /// Rotation as an axis-angle vector, in radians.
    pub rotation: [f64; 3],
}

/// The vehicle's clock minus the camera's.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct ClockOffset {
    /// Add this to the camera's times, as opened, to get the vehicle's, in seconds.
    pub vehicle_minus_camera_s: f64,
    /// Its standard error, in seconds.
    pub std_error_s: f64,
}

/// A camera's intrinsics, in pixels.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct IntrinsicsSummary {
    /// Focal length along x.
    pub fx: f64,
    /// Focal length along y.
    pub fy: f64,
    /// Principal point, x.
    pub cx: f64,
    /// Principal point, y.
    pub cy: f64,
}

/// A recorded stream of one sensor.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Stream {
    /// Name of its folder, file or topic, such as `image_02` or `speed.csv`.
    pub name: String,
    /// What it contains: `image`, `point_cloud`, `oxts`, `speed`, `imu`, `steering`, `depth`, `pose`, `frames`.
    #[serde(rename = "type")]
    pub kind: &'static str,
    /// Number of samples.
    pub count: usize,
    /// Inverse of the median interval, in Hz.
    pub rate_hz: Option<f64>,
    /// Number of intervals longer than 1.5 times the median.
    pub gaps: usize,
}

/// Lowest, mean and highest speed, in m/s.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct SpeedRange {
    /// Lowest speed.
    pub min: f64,
    /// Mean over the frames.
    pub mean: f64,
    /// Highest speed.
    pub max: f64,
}

impl Stream {
    /// A stream of `count` samples at these times, in seconds; give no times if they are unknown.
    #[must_use]
    pub fn new(name: &str, kind: &'static str, count: usize, times_s: &[f64]) -> Self {
        let intervals: Vec<f64> = times_s.windows(2).map(|w| w[1] - w[0]).collect();
        let mut sorted = intervals.clone();
        sorted.sort_by(f64::total_cmp);
        let median = sorted.get(sorted.len() / 2).copied().filter(|m| *m > 0.0);
        Self {
            name: name.to_owned(),
            kind,
            count,
            rate_hz: median.map(|m| 1.0 / m),
            gaps: median.map_or(0, |m| intervals.iter().filter(|i| **i > 1.5 * m).count()),
        }
    }
}

impl SpeedRange {
    /// The range of these speeds in m/s; `None` if there are none.
    pub(crate) fn of(speeds_mps: impl Iterator<Item = f64>) -> Option<Self> {
        let speeds: Vec<f64> = speeds_mps.collect();
        (!speeds.is_empty()).then(|| Self {
            min: speeds.iter().copied().fold(f64::INFINITY, f64::min),
            mean: speeds.iter().sum::<f64>() / speeds.len() as f64,
            max: speeds.iter().copied().fold(f64::NEG_INFINITY, f64::max),
        })
    }
}

impl From<Intrinsics> for IntrinsicsSummary {
    fn from(k: Intrinsics) -> Self {
        Self {
            fx: k.fx,
            fy: k.fy,
            cx: k.cx,
            cy: k.cy,
        }
    }
}
