//! Where an adapted network lies: while it is learned, when it is kept, refused, undone.

use std::ffi::OsString;
use std::fs;
use std::path::{Path, PathBuf};

use deepfusion_data::Error as DataError;
use deepfusion_fs::{publish_folder, unused};
use deepfusion_model::weights::{read_bytes, write_safetensors};
use deepfusion_model::{Checkpoint, CheckpointKind, RunFolder, TrainConfig};
use deepfusion_runtime::ModelSource;

use crate::files::write;
use crate::{Error, Result};

/// The given network, beside the one that was learned: its checkpoint and its configuration.
const START: [&str; 2] = ["start.safetensors", "start.toml"];
/// What becomes of the learned one where it is undone.
const ADAPTED: &str = "adapted-";

/// The folders of one adaptation.
pub(super) struct Folders {
    out: PathBuf,
    /// Not a [`deepfusion_fs::PartialFolder`]: its name is known, and what an interrupted process left there is gone on with.
    work: PathBuf,
}

impl Folders {
    /// Those of `out`, which must be new.
    pub(super) fn of(out: &Path) -> Result<Self> {
        let taken = match fs::read_dir(out) {
            Ok(mut entries) => entries.next().is_some(),
            Err(_) => out.exists(),
        };
        if taken {
            return Err(Error::AdaptedBefore {
                path: out.to_owned(),
            });
        }
        Ok(Self {
            out: out.to_owned(),
            work: beside(out, ".adapting"),
        })
    }

    /// Where is learned.
    pub(super) fn work(&self) -> &Path {
        &self.work
    }

    /// The run that was interrupted with the same settings; what it left before its first checkpoint is removed.
    pub(super) fn begun(&self, config: &TrainConfig) -> Result<Option<RunFolder>> {
        if !self.work.exists() {
            return Ok(None);
        }
        let another = || Error::OtherSettings {
            path: self.work.clone(),
        };
        let Ok((folder, _)) = RunFolder::open(&self.work) else {
            let ours = START.map(|name| self.work.join(name));
            let entries = fs::read_dir(&self.work).map_err(|e| DataError::file(&self.work, e))?;
            let mut entries = entries.filter_map(std::result::Result::ok);
            if entries.any(|entry| !ours.contains(&entry.path())) {
                return Err(another());
            }
            return self.remove().map(|()| None);
        };
        if folder.read_settings()? != *config {
            return Err(another());
        }
        if !folder.checkpoint_path(CheckpointKind::Last).exists() {
            return self.remove().map(|()| None);
        }
        Ok(Some(folder))
    }

    fn remove(&self) -> Result<()> {
        Ok(fs::remove_dir_all(&self.work).map_err(|e| DataError::file(&self.work, e))?)
    }

    /// Copies the given network, so that it can be gone back to wherever it came from.
    pub(super) fn keep_start(&self, given: &ModelSource) -> Result<()> {
        let [weights, config] = START.map(|name| self.work.join(name));
        match given {
            ModelSource::Run { folder, kind, .. } => {
                copy(&folder.checkpoint_path(*kind), &weights)?;
                copy(&folder.config_path(), &config)
            }
            ModelSource::Packed { network, .. } => {
                let read = read_bytes(&network.card.name, &network.bytes);
                let read = read.map_err(deepfusion_model::Error::from)?;
                let mut depth = read.with_prefix("depth.");
                let state = Checkpoint {
                    step: network.card.steps,
                    best_validation: None,
                    skipped: 0,
                    encoders_only: false,
                    focal_ratio: None,
                };
                depth.metadata.extend(state.metadata());
                write_safetensors(&weights, &depth).map_err(deepfusion_model::Error::from)?;
                Ok(write(
                    &config,
                    toml::to_string_pretty(&network.card.config)?,
                )?)
            }
        }
    }

    /// The work becomes the result.
    pub(super) fn keep(&self) -> Result<PathBuf> {
        self.rename_work(self.out.clone())
    }

    /// The work is laid aside, under a name that says so.
    pub(super) fn refuse(&self) -> Result<PathBuf> {
        self.rename_work(unused(&beside(&self.out, ".refused")))
    }

    /// Gives the work another name, under which all of it is on the disk.
    fn rename_work(&self, to: PathBuf) -> Result<PathBuf> {
        publish_folder(&self.work, &to).map_err(|e| DataError::file(&to, e))?;
        Ok(to)
    }
}

/// Makes an adapted run the network it began from; what was learned stays in it under other names.
///
/// # Errors
/// [`Error::NotAdapted`] where there is nothing to go back to; a folder that cannot be written.
pub fn undo(out: &Path) -> Result<()> {
    let [weights, config] = START.map(|name| out.join(name));
    if !weights.is_file() {
        let path = out.to_owned();
        return Err(Error::NotAdapted { path });
    }
    let (folder, _) = RunFolder::open(out)?;
    let aside = |path: &Path| {
        let mut name = OsString::from(ADAPTED);
        name.push(path.file_name().unwrap_or_default());
        out.join(name)
    };
    // In this order, so that an undoing that was cut off is finished by another.
    for kind in [CheckpointKind::Best, CheckpointKind::Last] {
        let path = folder.checkpoint_path(kind);
        if path.is_file() {
            publish(&path, &aside(&path))?;
        }
    }
    if config.is_file() {
        copy(&folder.config_path(), &aside(&folder.config_path()))?;
        publish(&config, &folder.config_path())?;
    }
    publish(&weights, &folder.checkpoint_path(CheckpointKind::Best))
}

/// `out` with an ending.
fn beside(out: &Path, end: &str) -> PathBuf {
    let mut name = out.as_os_str().to_owned();
    name.push(end);
    name.into()
}

/// Renames a file; its content and its new name are on the disk once this returns.
fn publish(from: &Path, to: &Path) -> Result<()> {
    Ok(deepfusion_fs::publish(from, to).map_err(|e| DataError::file(from, e))?)
}

fn copy(from: &Path, to: &Path) -> Result<()> {
    let bytes = fs::read(from).map_err(|e| DataError::file(from, e))?;
    Ok(write(to, bytes)?)
}
