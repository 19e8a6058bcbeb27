//! A folder's frames as a file for the rerun viewer (`.rrd`).
//!
//! | Entity | Holds |
//! |---|---|
//! | `world` | the axes: x right, y down, z forward, of the recording's first camera |
//! | `world/camera` | `world_from_cam`; identity if the camera's motion is unknown |
//! | `world/camera/image` | the pinhole camera |
//! | `world/camera/image/rgb`, `…/depth` | the picture's own bytes; depth in the numbers of its file, with their metre |
//! | `world/camera/targets`, `…/velocities`, `…/ground` | boxes, where they will be in a second, the road's plane; in the camera's axes |
//! | `world/tracks` | where the targets were |
//! | `speed_mps`, `time_to_collision_s`, `nearest_m`, `scale_ratio`, `latency_ms` | numbers of the frame |
//! | `frames` | the frame's name, and what is wrong with it |
//!
//! Timelines: `frame`, the place in the folder from 0, and `time`, seconds from the recording's first stamp, where it is known.
//! What is below the pinhole is a picture to the viewer, what is in metres therefore lies beside it.

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
    /// How many frames the file holds.
    pub frames: usize,
    /// What is wrong with which frames, in their order: name and problem. The rest of such a frame is in the file.
    pub problems: Vec<(String, FrameProblem)>,
}

/// Writes all frames of a folder to a file for the rerun viewer, beside its name first. What is wrong with a frame is reported,
/// and the rest goes on. `progress` receives the frames done and the total; if `stop` returns true, nothing is left behind.
///
/// # Errors
/// [`Error::NoFrames`] for a training run, [`Error::Stopped`], [`Error::File`] where writing fails, [`Error::Encoding`].
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
    let failed = |e| Error::from(deepfusion_images::Error::file(path, e));
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
