//! Finds out which images of a job are already done, and whether their outputs may stay.

use std::collections::HashSet;
use std::path::Path;
use std::sync::Arc;
use std::time::Duration;

use deepfusion_fs::Partial;
use deepfusion_records::{FileMark, MadeWith, Sidecar, same_number};
use rayon::prelude::*;
use serde::de::IgnoredAny;

use super::manifest::{Manifest, State};
use super::sidecars::{is_complete, sidecar_path};
use super::{CameraFrom, Lock, Shard, video};
use crate::{Error, Input, Result, StaleReason};

/// Temporary files not written to for this long are abandoned: writing an output takes seconds.
const ABANDONED: Duration = Duration::from_secs(3600);

/// What is made from images, and where.
#[derive(Debug, Clone)]
pub struct BulkJob<'a> {
    /// The folder of the outputs.
    pub folder: &'a Path,
    /// The endings of an image's outputs, after the image's name.
    pub endings: Vec<&'static str>,
    /// What else the outputs depend on.
    pub made_with: &'a MadeWith,
    /// Whether outputs are made again if they were made in another way, or if their image has changed.
    pub overwrite: bool,
    /// The shard of the images that this run processes.
    pub shard: Shard,
    /// Whether videos are made from the pictures at the end.
    pub videos: bool,
}

/// An image that is done.
struct Done {
    /// Only if sidecars are requested: those of a hundred thousand images take much memory.
    sidecar: Option<Box<Sidecar>>,
}

/// A job that has begun.
pub struct StartedJob {
    /// The manifest, as written into the folder: what is done and what is left.
    pub manifest: Manifest,
    /// Sidecars of finished images by index, if requested.
    pub sidecars: Vec<Option<Sidecar>>,
    /// Indices of the images left to do.
    pub todo: Vec<usize>,
}

impl BulkJob<'_> {
    /// Checks the existing outputs of the images (`mine` of `all`), and writes the manifest.
    ///
    /// # Errors
    /// [`Error::OtherJob`], [`Error::Stale`], [`Error::Exists`]; files that cannot be read or written.
    pub fn begin(&self, all: &[Input], mine: &[&Input], keep_sidecars: bool) -> Result<StartedJob> {
        let mut manifest = Manifest::new(self.shard, all, mine, self.made_with.clone());
        let before = Manifest::all(self.folder)?;
        if !self.overwrite {
            manifest.check_against(&before, self.folder)?;
            if self.videos {
                video::make_room(self.folder, all, &manifest, &before)?;
            }
        }
        self.remove_partial_files(mine)?;
        let begun = manifest.begun(&before);
        let mut todo = Vec::new();
        let mut sidecars = vec![None; if keep_sidecars { mine.len() } else { 0 }];
        // All existing outputs are read, to check that they are unchanged.
        let done = |sidecar| Done {
            sidecar: keep_sidecars.then(|| Box::new(sidecar)),
        };
        let found: Vec<Result<Option<Done>>> = mine
            .par_iter()
            .map(|input| {
                let known = begun.contains(&(input.path.as_path(), input.name.as_str()));
                self.finished(input, known).map(|found| found.map(done))
            })
            .collect();
        let mut found = found.into_iter().collect::<Result<Vec<_>>>()?;
        if self.made_with.correct_scale {
            begin_recordings_anew(mine, &mut found);
        }
        for (i, found) in found.into_iter().enumerate() {
            match found {
                None => todo.push(i),
                Some(Done { sidecar }) => {
                    manifest.images[i].state = State::Done;
                    if let (Some(place), Some(sidecar)) = (sidecars.get_mut(i), sidecar) {
                        *place = Some(*sidecar);
                    }
                }
            }
        }
        manifest.write(self.folder)?;
        // Checks again, now that other shards can see our manifest: if shards of two jobs start at the same time, one of them notices.
        let path = manifest.path(self.folder);
        let others = Manifest::all(self.folder)?;
        if !self.overwrite
            && let Err(error) = manifest.check_against(&others, self.folder)
        {
            std::fs::remove_file(&path).map_err(|e| deepfusion_data::Error::file(&path, e))?;
            return Err(error);
        }
        Ok(StartedJob {
            manifest,
            sidecars,
            todo,
        })
    }

    /// The sidecar of an image that is done; `None` if there is work to do.
    ///
    /// Files that another job made, or that were made before the image changed, are an error, or work to do if they may be overwritten.
    /// `begun` means that a run of this job had the image in its manifest: files without a sidecar are then what it left when it was
    /// killed. An image is done if every output's length and checksum match its sidecar.
    fn finished(&self, input: &Input, begun: bool) -> Result<Option<Sidecar>> {
        let path = sidecar_path(self.folder, &input.name);
        let text = match std::fs::read(&path) {
            Ok(text) => text,
            Err(e) if e.kind() == std::io::ErrorKind::NotFound => {
                if !(begun || self.overwrite) {
                    self.refuse_files(input)?;
                }
                return Ok(None);
            }
            Err(e) => return Err(deepfusion_data::Error::file(&path, e).into()),
        };
        if text.iter().all(|byte| *byte == 0) {
            // What a power cut leaves of a file: there is nothing in it to lose.
            return Ok(None);
        }
        let why = match serde_json::from_slice::<Sidecar>(&text) {
            // Ours, but truncated or overwritten.
            Err(_) if begun && serde_json::from_slice::<IgnoredAny>(&text).is_err() => {
                return Ok(None);
            }
            Err(_) => StaleReason::NoSidecar,
            Ok(sidecar) if sidecar.prediction.image.as_ref() != Some(&input.path) => {
                StaleReason::OtherImage(sidecar.prediction.image.unwrap_or_default())
            }
            Ok(sidecar) => match self.made_with.difference(&sidecar.made_with) {
                Some(what) => StaleReason::MadeWith(what),
                None if recalibrated(input, &sidecar) => StaleReason::Calibration,
                None if changed(input, &sidecar) => StaleReason::ImageChanged(input.path.clone()),
                None if is_complete(&sidecar, self.folder) => return Ok(Some(sidecar)),
                // Ours, but an output is missing or has changed.
                None => return Ok(None),
            },
        };
        if self.overwrite {
            return Ok(None);
        }
        Err(Error::Stale { path, why })
    }

    /// Refuses to replace files without a sidecar.
    fn refuse_files(&self, input: &Input) -> Result<()> {
        for ending in &self.endings {
            let path = self.folder.join(format!("{}{ending}", input.name));
            if path.exists() {
                return Err(Error::Exists { path });
            }
        }
        Ok(())
    }

    /// Removes the unfinished files that a killed run left of these images. A run with another number of shards may be writing the same
    /// images: while one is working, only files that have long been untouched are removed.
    fn remove_partial_files(&self, mine: &[&Input]) -> Result<()> {
        let out = self.folder;
        let files_of = |input: &&Input| {
            let endings = self.endings.iter().copied().chain([".json"]);
            let file = |ending| {
                let name = format!("{}{ending}", input.name);
                Partial::name_of(&name).into_owned()
            };
            endings.map(file).collect::<Vec<String>>()
        };
        let files: HashSet<String> = mine.iter().flat_map(files_of).collect();
        let failed = |e| deepfusion_data::Error::file(out, e);
        let mut partial = Vec::new();
        for entry in std::fs::read_dir(out).map_err(failed)? {
            let path = entry.map_err(failed)?.path();
            if Partial::target_of(&path).is_some_and(|file| files.contains(file)) {
                partial.push(path);
            }
        }
        if !partial.is_empty() && Lock::is_held_by_others(out, self.shard.count) {
            partial.retain(|path| is_abandoned(path));
        }
        for path in partial {
            match std::fs::remove_file(&path) {
                Err(e) if e.kind() != std::io::ErrorKind::NotFound => {
                    return Err(deepfusion_data::Error::file(&path, e).into());
                }
                _ => {}
            }
        }
        Ok(())
    }
}

/// Whether a file has not been written to for so long that no process will continue it.
fn is_abandoned(file: &Path) -> bool {
    let written = std::fs::metadata(file).and_then(|about| about.modified());
    let age = written.ok().and_then(|written| written.elapsed().ok());
    age.is_some_and(|age| age > ABANDONED)
}

/// Marks a recording's finished images as not done if some of its images are not done: a monitored scale has to be followed from the
/// recording's first frame.
fn begin_recordings_anew(mine: &[&Input], found: &mut [Option<Done>]) {
    let recording = |input: &Input| {
        input
            .frame
            .as_ref()
            .map(|(dataset, _)| Arc::as_ptr(dataset))
    };
    let each = mine.iter().zip(found.iter());
    let unfinished: HashSet<_> = each
        .filter(|(_, found)| found.is_none())
        .filter_map(|(input, _)| recording(input))
        .collect();
    for (input, found) in mine.iter().zip(found) {
        if recording(input).is_some_and(|dataset| unfinished.contains(&dataset)) {
            *found = None;
        }
    }
}

/// Whether the calibration of an image's recording has changed since its depth was made.
fn recalibrated(input: &Input, sidecar: &Sidecar) -> bool {
    let Some((dataset, frame)) = &input.frame else {
        return false;
    };
    let then = &sidecar.prediction;
    let by_its_own = then.intrinsics_from == CameraFrom::Recording.word();
    if by_its_own == dataset.camera_assumed() || then.undistorted != dataset.corrects_lens() {
        return true;
    }
    let k = dataset.intrinsics(*frame);
    let now = [k.fx, k.fy, k.cx, k.cy];
    let differs = |then: [f64; 4]| then.iter().zip(now).any(|(a, b)| !same_number(*a, b));
    by_its_own && then.intrinsics.is_some_and(differs)
}

/// Whether an image has changed since its outputs were made.
fn changed(input: &Input, sidecar: &Sidecar) -> bool {
    FileMark::of(&input.path).is_ok_and(|mark| Some(mark) != sidecar.prediction.image_file)
}
