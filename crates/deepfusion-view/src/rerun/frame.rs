//! Logs one frame for the rerun viewer.

use std::io::Write;
use std::path::Path;

use deepfusion_fs::FileError;
use deepfusion_geometry::Intrinsics;
use deepfusion_records::FrameRecord;
use re_log_types::{TimeInt, TimePoint, Timeline};
use re_sdk_types::AsComponents;
use re_sdk_types::archetypes::{DepthImage, EncodedImage, Pinhole, Scalars, TextLog, Transform3D};
use re_sdk_types::components::{PinholeProjection, TextLogLevel};
use re_sdk_types::datatypes::ChannelDatatype;

use super::recording::Recording;
use super::targets::{SeenTarget, boxes, ground, velocities};
use super::tracks::Tracks;
use crate::folder::{Entry, SmallFiles, Summary, details_of, picture_of};
use crate::{DepthCode, DepthFile, EncodingProblem, FrameProblem};

/// Logs frames in their order.
#[derive(Default)]
pub(super) struct FrameLogger {
    tracks: Tracks,
}

impl FrameLogger {
    /// Logs a frame's data and returns its problems.
    pub(super) fn log<W: Write>(
        &mut self,
        recording: &mut Recording<W>,
        folder: &Path,
        entry: &Entry,
        place: usize,
    ) -> Result<Vec<FrameProblem>, EncodingProblem> {
        let details = details_of(folder, entry);
        let (camera, mut problems) = (details.intrinsics, details.problems);
        let summary = Summary::read(folder, entry);
        let time = time_of(place, summary.time_s);

        let targets = SmallFiles::read(folder, entry).targets;
        let targets = targets.map_or_else(FrameRecord::default, |t| t.record);
        let world_from_cam = targets.camera_motion;
        recording.log("world/camera", &time, &transform(world_from_cam))?;
        let pinhole = camera.map(|k| pinhole(&k));
        recording.log_or_clear("world/camera/image", &time, any(&pinhole))?;

        let size = camera.map(|k| (k.width, k.height));
        let picture = picture(folder, entry, size, &mut problems);
        recording.log_or_clear("world/camera/image/rgb", &time, any(&picture))?;
        let depth = depth(folder, entry, size, &mut problems);
        recording.log_or_clear("world/camera/image/depth", &time, any(&depth))?;

        self.log_targets(recording, &time, &targets)?;
        for (entity, number) in [
            ("speed_mps", summary.speed_mps),
            ("time_to_collision_s", summary.time_to_collision_s),
            ("nearest_m", summary.nearest_m),
            ("scale_ratio", summary.scale_ratio),
            ("latency_ms", summary.latency_ms),
        ] {
            let scalar = number.map(Scalars::single);
            recording.log_or_clear(entity, &time, any(&scalar))?;
        }
        log_name(recording, &time, &entry.name, &problems)?;
        Ok(problems)
    }

    fn log_targets<W: Write>(
        &mut self,
        recording: &mut Recording<W>,
        time: &TimePoint,
        frame: &FrameRecord,
    ) -> Result<(), EncodingProblem> {
        let targets: Vec<SeenTarget> = frame.targets.iter().map(SeenTarget::of).collect();
        recording.log_or_clear("world/camera/targets", time, any(&boxes(&targets)))?;
        recording.log_or_clear("world/camera/velocities", time, any(&velocities(&targets)))?;
        recording.log_or_clear(
            "world/camera/ground",
            time,
            any(&frame.ground.and_then(ground)),
        )?;
        let paths = self.tracks.add(&targets, frame.camera_motion);
        recording.log_or_clear("world/tracks", time, any(&paths))
    }
}

fn any<T: AsComponents>(what: &Option<T>) -> Option<&dyn AsComponents> {
    what.as_ref().map(|w| w as &dyn AsComponents)
}

fn time_of(place: usize, time_s: Option<f64>) -> TimePoint {
    let frame = TimePoint::default().with(Timeline::new_sequence("frame"), place as i64);
    match time_s {
        Some(seconds) => frame.with(Timeline::new_duration("time"), TimeInt::from_secs(seconds)),
        None => frame,
    }
}

/// Converts `world_from_cam` from rows to the columns that the viewer expects. If it is unknown, the world's axes are the camera's.
fn transform(world_from_cam: Option<[f64; 12]>) -> Transform3D {
    const HERE: [f64; 12] = [1.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0];
    let m = world_from_cam.unwrap_or(HERE).map(|x| x as f32);
    let columns = [[m[0], m[4], m[8]], [m[1], m[5], m[9]], [m[2], m[6], m[10]]];
    Transform3D::from_translation_mat3x3([m[3], m[7], m[11]], columns)
}

/// In the viewer's cloud, pixel centres are integers as well, (u − cx)/fx, so nothing is shifted by half a pixel.
fn pinhole(k: &Intrinsics) -> Pinhole {
    Pinhole::new(PinholeProjection::from_focal_length_and_principal_point(
        [k.fx as f32, k.fy as f32],
        [k.cx as f32, k.cy as f32],
    ))
    .with_resolution([k.width as f32, k.height as f32])
}

/// The picture's bytes, unchanged. A picture of another size than the camera's is left out, since it would be misplaced.
fn picture(
    folder: &Path,
    entry: &Entry,
    size: Option<(u32, u32)>,
    problems: &mut Vec<FrameProblem>,
) -> Option<EncodedImage> {
    // A missing file or a wrong size has been reported with the frame.
    let picture = picture_of(folder, entry).ok()?;
    if size.is_some_and(|size| size != picture.size) {
        return None;
    }
    match std::fs::read(&picture.path) {
        Ok(bytes) => Some(EncodedImage::new(bytes).with_media_type(picture.content_type)),
        Err(e) => {
            let why = FileError::new(&picture.path, e).to_string();
            add(problems, FrameProblem::Unreadable(why));
            None
        }
    }
}

/// Depth in the numbers of its file. 0 means none, as in the viewer.
fn depth(
    folder: &Path,
    entry: &Entry,
    size: Option<(u32, u32)>,
    problems: &mut Vec<FrameProblem>,
) -> Option<DepthImage> {
    let depth = SmallFiles::read(folder, entry).depth(entry)?;
    let path = folder.join(&depth.file);
    let file = match DepthFile::read(&path) {
        Ok(file) => file,
        Err(e) => {
            add(problems, FrameProblem::Unreadable(e.to_string()));
            return None;
        }
    };
    let (width, height) = (file.width, file.height);
    let found = (width, height);
    if let Some(expected) = size.filter(|size| *size != found) {
        // A PNG's size has already been compared with the sidecar's.
        if file.code == DepthCode::Metres {
            add(problems, FrameProblem::DepthSize { found, expected });
        }
        return None;
    }
    let (datatype, values_per_metre) = match file.code {
        DepthCode::Steps256 => (ChannelDatatype::U16, 256.0_f32),
        DepthCode::Metres => (ChannelDatatype::F32, 1.0),
    };
    let image = DepthImage::from_data_type_and_bytes(file.values, [width, height], datatype);
    Some(image.with_meter(values_per_metre))
}

/// Adds a problem, unless it was already found elsewhere.
fn add(problems: &mut Vec<FrameProblem>, problem: FrameProblem) {
    if !problems.contains(&problem) {
        problems.push(problem);
    }
}

/// A line for the frame: its name, or a warning for each of its problems.
fn log_name<W: Write>(
    recording: &mut Recording<W>,
    time: &TimePoint,
    name: &str,
    problems: &[FrameProblem],
) -> Result<(), EncodingProblem> {
    if problems.is_empty() {
        let line = TextLog::new(name).with_level(TextLogLevel::INFO);
        return recording.log("frames", time, &line);
    }
    for problem in problems {
        let line = TextLog::new(format!("{name}: {problem}")).with_level(TextLogLevel::WARN);
        recording.log("frames", time, &line)?;
    }
    Ok(())
}
