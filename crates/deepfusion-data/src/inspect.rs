//! What is in a recording.

use crate::dataset::{CameraChoice, DatasetKind, OpenOptions};
use crate::kitti::{TimeStamps, layout};
use crate::{Dataset, Error, Result};
use deepfusion_geometry::Intrinsics;
use serde::Serialize;
use std::fmt;
use std::path::Path;

/// What `data inspect` tells, of one drive or several.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Inspection {
    /// The layout.
    pub kind: DatasetKind,
    /// Images of the camera, over all drives.
    pub frames: usize,
    /// Width and height of the images.
    pub size: [u32; 2],
    /// Their camera.
    pub intrinsics: IntrinsicsSummary,
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
}

/// One drive of an [`Inspection`].
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct DriveInspection {
    /// The drive's name.
    pub name: String,
    /// The camera looked at: 2, or 3 where there is only that.
    pub camera: u8,
    /// Its images.
    pub frames: usize,
    /// Numbers that are missing between its first and last image, as ranges `[from, to]`.
    pub missing_frames: Vec<[u64; 2]>,
    /// Pairs of neighbouring frames that can train at 0.5 m/s or more.
    pub usable_pairs: usize,
    /// Why there are none, if so.
    pub why_no_pairs: Option<String>,
    /// Frames with a velodyne scan.
    pub scans: usize,
    /// Speeds at the frames.
    pub speed_mps: Option<SpeedRange>,
    /// Distance driven, in metres.
    pub distance_m: Option<f64>,
    /// Sum of the changes of heading, in radians, positive to the left.
    pub turn_rad: Option<f64>,
    /// Time from the first to the last frame, in seconds.
    pub duration_s: Option<f64>,
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
    /// Its folder, such as `image_02`.
    pub name: String,
    /// What it holds: `image`, `point_cloud`, `oxts`.
    #[serde(rename = "type")]
    pub kind: &'static str,
    /// How many files.
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

/// Looks into a drive, a date folder or a KITTI root.
///
/// # Errors
/// As [`Dataset::open`]; time stamps and oxts may be missing and are then told as unknown.
pub fn inspect(path: &Path) -> Result<Inspection> {
    let open = |camera| {
        Dataset::open(
            path,
            &OpenOptions {
                camera,
                split: None,
            },
        )
    };
    let datasets = match open(CameraChoice::Left) {
        Err(Error::NoImages { .. }) => open(CameraChoice::Right),
        other => other,
    }?;
    let mut streams = Vec::new();
    let mut drives = Vec::new();
    for dataset in &datasets {
        for mut stream in streams_of(dataset)? {
            if datasets.len() > 1 {
                stream.name = format!("{}/{}", dataset.name(), stream.name);
            }
            streams.push(stream);
        }
        drives.push(look_at(dataset)?);
    }
    let k = datasets[0].intrinsics(0);
    Ok(Inspection {
        kind: datasets[0].kind(),
        frames: drives.iter().map(|d| d.frames).sum(),
        size: [k.width, k.height],
        intrinsics: IntrinsicsSummary::from(k),
        streams,
        speed_mps: speeds(&datasets),
        distance_m: sum(drives.iter().map(|d| d.distance_m)),
        duration_s: sum(drives.iter().map(|d| d.duration_s)),
        drives,
    })
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

/// Pairs slower than this are counted as unusable, as in training (SPEC 3.5).
const MIN_SPEED_MPS: f64 = 0.5;

fn look_at(dataset: &Dataset) -> Result<DriveInspection> {
    let frames = dataset.frames();
    let (usable_pairs, why_no_pairs) = match dataset.snippets(&[1], MIN_SPEED_MPS) {
        Ok(snippets) => (snippets.len(), None),
        Err(why) => (0, Some(why.to_string())),
    };
    let (mut distance_m, mut turn_rad) = (None, None);
    for pair in frames.windows(2) {
        let (Some(track), Some(from), Some(to)) = (dataset.track(), pair[0].time_s, pair[1].time_s)
        else {
            continue;
        };
        if let Some(motion) = track.motion(from, to) {
            *distance_m.get_or_insert(0.0) += motion.distance_m.abs();
            *turn_rad.get_or_insert(0.0) += motion.yaw_rad;
        }
    }
    let ends = frames.first().zip(frames.last());
    Ok(DriveInspection {
        name: dataset.name().to_owned(),
        camera: dataset.camera().number(),
        frames: frames.len(),
        missing_frames: frames
            .windows(2)
            .filter(|pair| pair[1].number > pair[0].number + 1)
            .map(|pair| [pair[0].number + 1, pair[1].number - 1])
            .collect(),
        usable_pairs,
        why_no_pairs,
        scans: frames
            .iter()
            .filter(|f| dataset.drive().scan(f.number).is_some())
            .count(),
        speed_mps: speeds(std::slice::from_ref(dataset)),
        distance_m,
        turn_rad,
        duration_s: ends.and_then(|(first, last)| Some(last.time_s? - first.time_s?)),
    })
}

fn speeds(datasets: &[Dataset]) -> Option<SpeedRange> {
    let frames = datasets.iter().flat_map(|d| d.frames());
    let speeds: Vec<f64> = frames.filter_map(|f| f.speed_mps).collect();
    (!speeds.is_empty()).then(|| SpeedRange {
        min: speeds.iter().copied().fold(f64::INFINITY, f64::min),
        mean: speeds.iter().sum::<f64>() / speeds.len() as f64,
        max: speeds.iter().copied().fold(f64::NEG_INFINITY, f64::max),
    })
}

/// The sum of what is known; `None` if nothing is.
fn sum(values: impl Iterator<Item = Option<f64>>) -> Option<f64> {
    values
        .flatten()
        .fold(None, |sum, value| Some(sum.unwrap_or(0.0) + value))
}

fn streams_of(dataset: &Dataset) -> Result<Vec<Stream>> {
    const SENSORS: [(&str, &str, &[&str]); 6] = [
        ("image_00", "image", &["jpeg", "jpg", "png"]),
        ("image_01", "image", &["jpeg", "jpg", "png"]),
        ("image_02", "image", &["jpeg", "jpg", "png"]),
        ("image_03", "image", &["jpeg", "jpg", "png"]),
        ("velodyne_points", "point_cloud", &["bin"]),
        ("oxts", "oxts", &["txt"]),
    ];
    let mut streams = Vec::new();
    for (name, kind, extensions) in SENSORS {
        let folder = dataset.drive().folder.join(name);
        if !folder.join("data").is_dir() {
            continue;
        }
        let files = layout::numbered_files(&folder.join("data"), extensions)?;
        let times = match TimeStamps::read(&folder.join("timestamps.txt")) {
            Err(Error::Missing { .. }) => None,
            other => Some(other?),
        };
        let mut seconds = Vec::new();
        if let Some(times) = times {
            let origin = times.origin_ns().unwrap_or(0);
            for (number, _) in &files {
                seconds.extend(times.seconds(*number, origin)?);
            }
        }
        let intervals: Vec<f64> = seconds.windows(2).map(|w| w[1] - w[0]).collect();
        let mut sorted = intervals.clone();
        sorted.sort_by(f64::total_cmp);
        let median = sorted.get(sorted.len() / 2).copied().filter(|m| *m > 0.0);
        streams.push(Stream {
            name: name.to_owned(),
            kind,
            count: files.len(),
            rate_hz: median.map(|m| 1.0 / m),
            gaps: median.map_or(0, |m| intervals.iter().filter(|i| **i > 1.5 * m).count()),
        });
    }
    Ok(streams)
}

impl fmt::Display for Inspection {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let k = &self.intrinsics;
        writeln!(
            f,
            "KITTI raw, {} frames of {}x{}",
            self.frames, self.size[0], self.size[1]
        )?;
        writeln!(
            f,
            "camera: fx {:.2}, fy {:.2}, cx {:.2}, cy {:.2} px",
            k.fx, k.fy, k.cx, k.cy
        )?;
        let known = |value: Option<f64>, unit: &str| match value {
            Some(value) => format!("{value:.1} {unit}"),
            None => "unknown".into(),
        };
        let speed = |range: Option<SpeedRange>| match range {
            Some(r) => format!("{:.1} to {:.1} m/s, mean {:.1}", r.min, r.max, r.mean),
            None => "unknown".into(),
        };
        for drive in &self.drives {
            writeln!(f, "\n{} (camera {})", drive.name, drive.camera)?;
            writeln!(
                f,
                "  frames    {}{}",
                drive.frames,
                missing(&drive.missing_frames)
            )?;
            writeln!(
                f,
                "  driven    {} in {}, turned {}",
                known(drive.distance_m, "m"),
                known(drive.duration_s, "s"),
                known(drive.turn_rad.map(f64::to_degrees), "degrees")
            )?;
            writeln!(f, "  speed     {}", speed(drive.speed_mps))?;
            writeln!(f, "  pairs     {} usable for training", drive.usable_pairs)?;
            if let Some(why) = &drive.why_no_pairs {
                writeln!(f, "            {why}")?;
            }
            writeln!(f, "  scans     {} frames with ground truth", drive.scans)?;
        }
        let width = self.streams.iter().map(|s| s.name.len()).max().unwrap_or(0);
        let width = width.max("stream".len());
        writeln!(
            f,
            "\n{:width$}  {:11}  {:>6}  {:>7}  {:>4}",
            "stream", "type", "count", "rate", "gaps"
        )?;
        for s in &self.streams {
            let rate = s
                .rate_hz
                .map_or_else(|| "-".into(), |r| format!("{r:.1} Hz"));
            writeln!(
                f,
                "{:width$}  {:11}  {:>6}  {rate:>7}  {:>4}",
                s.name, s.kind, s.count, s.gaps
            )?;
        }
        Ok(())
    }
}

/// `, missing 3, 7-9` with the first few ranges.
fn missing(ranges: &[[u64; 2]]) -> String {
    if ranges.is_empty() {
        return String::new();
    }
    let show = |[from, to]: &[u64; 2]| match from == to {
        true => from.to_string(),
        false => format!("{from}-{to}"),
    };
    let shown: Vec<String> = ranges.iter().take(6).map(show).collect();
    let more = if ranges.len() > shown.len() {
        ", …"
    } else {
        ""
    };
    format!(", missing {}{more}", shown.join(", "))
}
