//! The folders of an adapted network: while it is trained, when it is kept, refused or undone.

use std::ffi::OsString;
use std::fs;
use std::path::{Path, PathBuf};

use deepfusion_data::Error as DataError;
use deepfusion_fs::{publish_folder, unused};
use deepfusion_model::weights::{read_bytes, write_safetensors};
use deepfusion_model::{Checkpoint, CheckpointKind, RunFolder, TrainConfig};
use deepfusion_runtime::ModelSource;

use super::super::RunLock;
use crate::files::write;
use crate::{Error, Result};

/// Files of the given network, beside the adapted one: its checkpoint and its configuration.
const START: [&str; 2] = ["start.safetensors", "start.toml"];
/// Prefix for the adapted network's files after it was undone.
const ADAPTED: &str = "adapted-";

/// The folders of one adaptation.
pub(super) struct Folders {
    out: PathBuf,
    /// Not a [`deepfusion_fs::PartialFolder`]: its name is fixed, so that an interrupted adaptation can be continued.
    work: PathBuf,
}

impl Folders {
    /// The folders for the output `out`, which must be new.
    pub(super) fn of(given: &Path) -> Result<Self> {
        let out = resolved(given)?;
        let path = || given.to_owned();
        let taken = match fs::read_dir(&out) {
            Ok(mut entries) => entries.next().is_some(),
            Err(_) => out.exists(),
        };
        if taken {
            return Err(Error::AdaptedBefore { path: path() });
        }
        if is_mount_point(&out) {
            return Err(Error::MountPoint { path: path() });
        }
        Ok(Self {
            work: beside(&out, ".adapting"),
            out,
        })
    }

    /// The folder of the training.
    pub(super) fn work(&self) -> &Path {
        &self.work
    }

    /// The lock of the training's folder; `None` if it does not exist.
    ///
    /// # Errors
    /// [`Error::RunBusy`] if another process is training there.
    pub(super) fn lock(&self) -> Result<Option<RunLock>> {
        if self.work.is_dir() {
            RunLock::take(&self.work).map(Some)
        } else {
            Ok(None)
        }
    }

    /// The run that was interrupted with the same settings. If it has no checkpoint yet, it is removed.
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

    /// Copies the given network, so that it can be restored even if its own folder is gone.
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

    /// Renames the training's folder to the output.
    pub(super) fn keep(&self) -> Result<PathBuf> {
        self.rename_work(self.out.clone())
    }

    /// Renames the training's folder, marking it as refused.
    pub(super) fn refuse(&self) -> Result<PathBuf> {
        self.rename_work(unused(&beside(&self.out, ".refused")))
    }

    /// Renames the training's folder; its content is synced first.
    fn rename_work(&self, to: PathBuf) -> Result<PathBuf> {
        publish_folder(&self.work, &to).map_err(|e| DataError::file(&to, e))?;
        Ok(to)
    }
}

/// Turns an adapted run back into the network that it started from; the adapted network's files stay in it under other names.
///
/// # Errors
/// [`Error::NotAdapted`] if there is nothing to restore; a folder that cannot be written.
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
    // In this order, so that an interrupted undo can be completed by another one.
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

/// The folder without a slash at the end; a link is resolved, since a folder cannot be renamed to it.
fn resolved(given: &Path) -> Result<PathBuf> {
    let out: PathBuf = given.components().collect();
    if out.is_symlink() || out.file_name().is_none() {
        return Ok(fs::canonicalize(&out).map_err(|e| DataError::file(given, e))?);
    }
    Ok(out)
}

/// Whether a folder exists and is on another file system than its parent, so that nothing can be renamed to it.
#[cfg(unix)]
fn is_mount_point(folder: &Path) -> bool {
    use std::os::unix::fs::MetadataExt as _;
    let device = |path: &Path| fs::metadata(path).map(|found| found.dev()).ok();
    let (own, around) = (device(folder), device(&folder.join("..")));
    own.zip(around).is_some_and(|(own, around)| own != around)
}

#[cfg(not(unix))]
fn is_mount_point(_: &Path) -> bool {
    false
}

/// `out` with a suffix appended to its name.
fn beside(out: &Path, end: &str) -> PathBuf {
    let mut name = out.file_name().unwrap_or_default().to_owned();
    name.push(end);
    out.with_file_name(name)
}

/// Renames a file; its content and its new name are synced once this returns.
fn publish(from: &Path, to: &Path) -> Result<()> {
    Ok(deepfusion_fs::publish(from, to).map_err(|e| DataError::file(from, e))?)
}

fn copy(from: &Path, to: &Path) -> Result<()> {
    let bytes = fs::read(from).map_err(|e| DataError::file(from, e))?;
    Ok(write(to, bytes)?)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_training_folder_is_beside_the_output_however_it_is_given() {
        let at = tempfile::tempdir().unwrap();
        let at = at.path();
        for given in ["mine", "mine/", "mine/.", "./mine//"] {
            let folders = Folders::of(&at.join(given)).unwrap();
            assert_eq!(folders.work(), at.join("mine.adapting"), "{given}");
            fs::create_dir(folders.work()).unwrap();
            assert_eq!(folders.keep().unwrap(), at.join("mine"), "{given}");
            fs::remove_dir(at.join("mine")).unwrap();
        }
        assert_eq!(
            beside(Path::new("mine/"), ".refused"),
            Path::new("mine.refused")
        );
        // An empty folder counts as new; one with content does not.
        fs::create_dir(at.join("mine")).unwrap();
        Folders::of(&at.join("mine/")).unwrap();
        fs::write(at.join("mine/file"), "x").unwrap();
        let error = Folders::of(&at.join("mine/")).err().unwrap();
        assert!(matches!(error, Error::AdaptedBefore { .. }), "{error}");
    }

    #[cfg(unix)]
    #[test]
    fn the_target_of_a_link_is_replaced() {
        let at = tempfile::tempdir().unwrap();
        let at = fs::canonicalize(at.path()).unwrap();
        let (link, target) = (at.join("link"), at.join("disk/mine"));
        std::os::unix::fs::symlink(&target, &link).unwrap();
        let error = Folders::of(&link).err().unwrap().to_string();
        assert!(error.contains("link"), "a link to nothing: {error}");
        fs::create_dir_all(&target).unwrap();
        let folders = Folders::of(&link).unwrap();
        assert_eq!(folders.work(), at.join("disk/mine.adapting"));
        fs::create_dir(folders.work()).unwrap();
        fs::write(folders.work().join("config.toml"), "").unwrap();
        folders.keep().unwrap();
        assert!(link.join("config.toml").exists() && link.is_symlink());
        assert!(!is_mount_point(&target));
    }

    #[cfg(target_os = "linux")]
    #[test]
    fn a_mount_point_is_distinguished_from_a_folder() {
        assert!(is_mount_point(Path::new("/proc")));
        assert!(!is_mount_point(Path::new("/no such folder")));
    }
}
