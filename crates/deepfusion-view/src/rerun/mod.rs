//! A folder's frames as a file for the rerun viewer (`.rrd`).
//!
//! | Entity | Holds |
//! |---|---|
//! | `world` | the axes: x right, y down, z forward, of the recording's first camera |
//! | `world/camera` | `world_from_cam`; identity if the camera's motion is unknown |
//! | `world/camera/image` | the pinhole camera |
//! | `world/camera/image/rgb`, `…/depth` | the picture's own bytes; depth in the numbers of its file, with their metre |
//! | `world/camera/targets`, `…/velocities`, `…/ground` | boxes, arrows to their positions in a second, the road's plane; in the camera's axes |
//! | `world/tracks` | the targets' past positions |
//! | `speed_mps`, `time_to_collision_s`, `nearest_m`, `scale_ratio`, `latency_ms` | numbers of the frame |
//! | `frames` | the frame's name, or its problems |
//!
//! Timelines: `frame`, the index in the folder from 0, and `time`, seconds from the recording's first stamp, if known.
//! The viewer takes everything below the pinhole for a picture, so data in metres is beside it.

mod frame;
mod recording;
mod targets;
mod tracks;

use std::path::Path;

use crate::{Error, Folder, FolderKind, FrameProblem, Result};

use self::frame::FrameLogger;
use self::recording::Recording;

/// The version of the SDK that writes the files; viewers of that version and newer ones read them.
#[must_use]
pub fn rerun_version() -> String {
    re_build_info::CrateVersion::LOCAL.to_string()
}

/// What [`write_rerun`] wrote.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct RerunReport {
    /// Number of frames in the file.
    pub frames: usize,
    /// Problems in the order of the frames: the frame's name and the problem. The rest of such a frame is in the file.
    pub problems: Vec<(String, FrameProblem)>,
}

/// Writes all frames of a folder to a file for the rerun viewer, first under a temporary name. Problems with a frame are reported,
/// and the rest is written. `progress` receives the frames done and the total; if `stop` returns true, no file is left.
///
/// # Errors
/// [`Error::NoFrames`] for a training run, [`Error::Stopped`], [`Error::File`] if writing fails, [`Error::Encoding`].
pub fn write_rerun(
    folder: &Folder,
    path: &Path,
    mut progress: impl FnMut(usize, usize),
    stop: impl Fn() -> bool,
) -> Result<RerunReport> {
    if folder.kind() == FolderKind::Training {
        return Err(Error::NoFrames {
            path: folder.path().to_owned(),
        });
    }
    let frames = folder.entries(0, usize::MAX);
    let mut report = RerunReport::default();
    let failed = |e| Error::file(path, e);
    deepfusion_fs::write_atomically(path, failed, |out| {
        let recording = Recording::begin(out, &folder.name());
        let mut recording = recording.map_err(|e| e.of(path))?;
        let mut logger = FrameLogger::default();
        for (place, entry) in frames.iter().enumerate() {
            if stop() {
                return Err(Error::Stopped {
                    path: path.to_owned(),
                    done: place,
                    total: frames.len(),
                });
            }
            let problems = logger.log(&mut recording, folder.path(), entry, place);
            let named = problems.map_err(|e| e.of(path))?.into_iter();
            report
                .problems
                .extend(named.map(|problem| (entry.name.clone(), problem)));
            progress(place + 1, frames.len());
        }
        recording.finish().map_err(|e| e.of(path))
    })?;
    report.frames = frames.len();
    Ok(report)
}
