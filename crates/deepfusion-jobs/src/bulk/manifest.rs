//! What a shard has to do and has done, in the output folder: `predict-I-of-N.manifest.json`.

use std::collections::HashSet;
use std::fs::{File, TryLockError};
use std::path::{Path, PathBuf};

use deepfusion_records::MadeWith;
use serde::{Deserialize, Serialize};
use sha2::{Digest, Sha256};

use super::Shard;
use super::sidecars::write_json;
use crate::{Error, Input, OtherJob, Result};

/// The manifest of one shard.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Manifest {
    /// Which shard, counted from 1, of how many.
    pub shard: [usize; 2],
    /// Images of all shards.
    pub inputs: usize,
    /// SHA-256 of all inputs' paths and names: equal for all shards of a job.
    pub inputs_sha256: String,
    /// Program, weights and options.
    pub made_with: MadeWith,
    /// This shard's images.
    pub images: Vec<Entry>,
}

/// One image of a manifest.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Entry {
    /// The input.
    pub image: PathBuf,
    /// What its outputs' names begin with.
    pub name: String,
    /// How far it is. A run that was killed may have done more than this says: the sidecars tell.
    pub state: State,
    /// Why it failed.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub error: Option<String>,
}

/// How far an image is.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum State {
    /// Not begun, or not finished.
    Waiting,
    /// All outputs are there.
    Done,
    /// Could not be read or predicted.
    Failed,
}

impl Manifest {
    /// Nothing done yet; `mine` are the shard's own of `all` inputs.
    #[must_use]
    pub fn new(shard: Shard, all: &[Input], mine: &[&Input], made_with: MadeWith) -> Self {
        let mut hash = Sha256::new();
        for input in all {
            hash.update(input.path.as_os_str().as_encoded_bytes());
            hash.update([0]);
            hash.update(&input.name);
            hash.update([0]);
        }
        let entry = |input: &&Input| Entry {
            image: input.path.clone(),
            name: input.name.clone(),
            state: State::Waiting,
            error: None,
        };
        Self {
            shard: [shard.index, shard.count],
            inputs: all.len(),
            inputs_sha256: format!("{:x}", hash.finalize()),
            made_with,
            images: mine.iter().map(entry).collect(),
        }
    }

    /// Where it lies.
    #[must_use]
    pub fn path(&self, folder: &Path) -> PathBuf {
        let [index, count] = self.shard;
        folder.join(format!("predict-{index}-of-{count}.manifest.json"))
    }

    /// Images that are done.
    #[must_use]
    pub fn done(&self) -> usize {
        let is_done = |e: &&Entry| e.state == State::Done;
        self.images.iter().filter(is_done).count()
    }

    /// Writes it, atomically.
    ///
    /// # Errors
    /// Where it cannot be written.
    pub fn write(&self, folder: &Path) -> Result<()> {
        write_json(self, &self.path(folder))
    }

    /// The manifests of the folder. A file of such a name that is no manifest is left alone.
    ///
    /// # Errors
    /// A folder that cannot be listed.
    pub fn all(folder: &Path) -> Result<Vec<Self>> {
        let failed = |e| deepfusion_data::Error::file(folder, e);
        let mut found = Vec::new();
        for entry in std::fs::read_dir(folder).map_err(failed)? {
            let path = entry.map_err(failed)?.path();
            let name = path.file_name().unwrap_or_default().to_string_lossy();
            if name.starts_with("predict-") && name.ends_with(".manifest.json") {
                let text = std::fs::read(&path).unwrap_or_default();
                found.extend(serde_json::from_slice::<Self>(&text));
            }
        }
        Ok(found)
    }

    /// Refuses to work beside shards (of the same number) of another job: their parts of the inputs and this
    /// one's would overlap or leave some out.
    ///
    /// # Errors
    /// [`Error::OtherJob`].
    pub fn check_against(&self, others: &[Self], folder: &Path) -> Result<()> {
        // A job of one shard has nothing to agree with: a folder may be filled by several commands.
        let same = |other: &&Self| self.shard[1] > 1 && other.shard[1] == self.shard[1];
        for other in others.iter().filter(same) {
            let why = if other.inputs_sha256 != self.inputs_sha256 {
                OtherJob::Inputs(other.inputs, self.inputs)
            } else if let Some(what) = self.made_with.difference(&other.made_with) {
                OtherJob::MadeWith(what)
            } else {
                continue;
            };
            let path = other.path(folder);
            return Err(Error::OtherJob { path, why });
        }
        Ok(())
    }

    /// Names of the images whose outputs a run of the same job had begun.
    #[must_use]
    pub fn begun<'a>(&self, others: &'a [Self]) -> HashSet<(&'a Path, &'a str)> {
        let same = others
            .iter()
            .filter(|o| self.made_with.difference(&o.made_with).is_none());
        let entries = same.flat_map(|o| &o.images);
        entries
            .map(|e| (e.image.as_path(), e.name.as_str()))
            .collect()
    }
}

/// Held while a shard is worked on, so that nobody else does. The system frees it with the process, however that ends; its
/// empty file stays: who removed it could take it from under another run that has it open and is about to hold it.
#[derive(Debug)]
pub struct Lock {
    _file: File,
}

impl Lock {
    /// Takes the lock of a shard.
    ///
    /// # Errors
    /// [`Error::Busy`] where another process has it; a folder that cannot be written to.
    pub fn take(folder: &Path, shard: Shard) -> Result<Self> {
        let Shard { index, count } = shard;
        let path = folder.join(format!(".predict-{index}-of-{count}.lock"));
        let file = File::create(&path).map_err(|e| deepfusion_data::Error::file(&path, e))?;
        match file.try_lock() {
            Ok(()) => {}
            Err(TryLockError::WouldBlock) => {
                let folder = folder.to_owned();
                return Err(Error::Busy { folder, shard });
            }
            // Some network file systems have no locks; two runs of one shard then write the same files twice,
            // each whole.
            Err(TryLockError::Error(error)) => {
                tracing::warn!(
                    "{}: cannot be locked ({error}): start each shard once",
                    path.display()
                );
            }
        }
        Ok(Self { _file: file })
    }

    /// Takes the lock of all that is done in a folder, for work that has no shards: it is that of the only shard.
    ///
    /// # Errors
    /// [`Error::FolderBusy`] where another process has it; a folder that cannot be written to.
    pub fn take_whole(folder: &Path) -> Result<Self> {
        Self::take(folder, Shard::WHOLE).map_err(|error| match error {
            Error::Busy { folder, .. } => Error::FolderBusy { folder },
            other => other,
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A run that opened the file while another held it, and gets it after that: a third one must see it held.
    #[test]
    fn a_lock_that_was_waited_for_is_seen_by_others() {
        let folder = tempfile::tempdir().unwrap();
        let first = Lock::take(folder.path(), Shard::WHOLE).unwrap();
        let busy = Lock::take(folder.path(), Shard::WHOLE).unwrap_err();
        assert!(busy.to_string().contains("at work on shard 1/1"), "{busy}");
        let file = folder.path().join(".predict-1-of-1.lock");
        let second = File::open(&file).unwrap();
        drop(first);
        second.try_lock().unwrap();
        let third = Lock::take(folder.path(), Shard::WHOLE).unwrap_err();
        assert!(third.to_string().contains("at work"), "{third}");
        // Work without shards waits for it, too.
        let whole = Lock::take_whole(folder.path()).unwrap_err();
        assert!(matches!(whole, Error::FolderBusy { .. }), "{whole}");
        drop(second);
        drop(Lock::take(folder.path(), Shard::WHOLE).unwrap());
        Lock::take_whole(folder.path()).unwrap();
    }
}
