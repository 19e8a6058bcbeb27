//! What is in a recording, as `data inspect` prints it.

use super::kind::DatasetKind;
use super::warning::DataWarning;
use crate::Error;
use deepfusion_geometry::Intrinsics;
use serde::{Serialize, Serializer};
use std::fmt::Display;
use std::path::{Path, PathBuf};
use std::sync::Arc;

/// What `data inspect` reports, of one drive or several.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Inspection {
    /// The layout.
    pub kind: DatasetKind,
    /// Images of the camera, over all drives.
    pub frames: usize,
    /// Width and height of the images; `None` (JSON `null`) where there are none.
    pub size: Option<[u32; 2]>,
    /// Their camera, after the lens' distortion was taken out.
    pub intrinsics: Option<IntrinsicsSummary>,
    /// What was recorded, with its drive before its name where there are several.
    pub streams: Vec<Stream>,
    /// Speeds at the frames; `None` (JSON `null`) where they are unknown.
    pub speed_mps: Option<SpeedRange>,
    /// Distance driven between first and last frames, in metres, gaps left out.
    pub distance_m: Option<f64>,
    /// Time from first to last frames, in seconds.
    pub duration_s: Option<f64>,
    /// Each drive by itself.
    pub drives: Vec<DriveInspection>,
    /// Of several recordings those that cannot be read, which the figures above leave out; absent from JSON where there are none.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub unreadable: Vec<Unreadable>,
}

/// One of several recordings, which cannot be read.
#[derive(Debug, Clone, Serialize)]
pub struct Unreadable {
    /// Its file or folder.
    #[serde(serialize_with = "path_text")]
    pub path: PathBuf,
    /// Why it cannot; its message in JSON.
    #[serde(serialize_with = "text")]
    pub error: Arc<Error>,
}

/// Errors are alike by what they say.
impl PartialEq for Unreadable {
    fn eq(&self, other: &Self) -> bool {
        let said = |one: &Self| (one.path.clone(), one.error.to_string());
        said(self) == said(other)
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
    /// The camera looked at: 2, or 3 where no drive has images of 2. Layouts other than KITTI's have one, which counts as 2.
    pub camera: u8,
    /// Its images.
    pub frames: usize,
    /// Numbers that are missing between its first and last image, as ranges `[from, to]`.
    pub missing_frames: Vec<[u64; 2]>,
    /// Pairs of neighbouring frames that can train at 0.5 m/s or more.
    pub usable_pairs: usize,
    /// Why there are none, if so.
    pub why_no_pairs: Option<String>,
    /// Frames with ground truth: a velodyne scan or a depth image.
    pub scans: usize,
    /// Speeds at the frames.
    pub speed_mps: Option<SpeedRange>,
    /// Distance driven, in metres.
    pub distance_m: Option<f64>,
    /// Sum of the changes of heading, in radians, positive to the left; `None` where no yaw rate was recorded.
    pub turn_rad: Option<f64>,
    /// Time from the first to the last frame, in seconds.
    pub duration_s: Option<f64>,
    /// What was taken off the images' times, in seconds: how far the camera's clock is ahead of the vehicle's, as the
    /// recording's file or the caller says.
    pub camera_ahead_s: f64,
    /// How far the vehicle's clock is then still ahead of the camera's, by how the pictures moved. `None` where nobody
    /// measured it ([`crate::inspect_with`]), the drive does not show it, or there are several drives.
    pub time_offset: Option<ClockOffset>,
    /// Where its sensors are, and by whom; of a bag.
    pub mounts: Vec<Mount>,
    /// What was taken for granted or looks odd; `remarks` in JSON, in sentences.
    #[serde(rename = "remarks", serialize_with = "texts")]
    pub warnings: Vec<DataWarning>,
}

/// Where a sensor is, as the file beside a bag has it.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Mount {
    /// Which transform: `cam_from_vehicle`, `cam_from_lidar`, `vehicle_from_imu`. Camera axes: x right, y down, z forward; the
    /// others': x forward, y left, z up.
    pub name: &'static str,
    /// Who says so.
    pub source: String,
    /// In metres.
    pub translation: [f64; 3],
    /// An axis-angle vector in radians.
    pub rotation: [f64; 3],
}

/// The vehicle's clock less the camera's.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct ClockOffset {
    /// What to add to the camera's times, as they were opened, to have the vehicle's, in seconds.
    pub vehicle_minus_camera_s: f64,
    /// Its standard error, in seconds.
    pub std_error_s: f64,
}

/// A camera's numbers, in pixels.
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

/// One sensor's recording.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Stream {
    /// Its folder or file, such as `image_02` or `speed.csv`.
    pub name: String,
    /// What it holds: `image`, `point_cloud`, `oxts`, `speed`, `imu`, `steering`, `depth`, `pose`, `frames`.
    #[serde(rename = "type")]
    pub kind: &'static str,
    /// How many samples.
    pub count: usize,
    /// One over the median interval, in Hz.
    pub rate_hz: Option<f64>,
    /// Intervals longer than one and a half medians.
    pub gaps: usize,
}

/// Least, mean and greatest speed, in m/s.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct SpeedRange {
    /// Least.
    pub min: f64,
    /// Mean over frames.
    pub mean: f64,
    /// Greatest.
    pub max: f64,
}

impl Stream {
    /// A stream of `count` samples at these times, in seconds; empty where they are not known.
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
    /// Of speeds in m/s; `None` where there are none.
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
