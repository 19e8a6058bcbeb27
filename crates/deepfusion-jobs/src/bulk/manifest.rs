//! What a shard has to do and has done: `predict-I-of-N.manifest.json` in the output folder.

use std::collections::HashSet;
use std::path::{Path, PathBuf};

use deepfusion_records::MadeWith;
use serde::{Deserialize, Serialize, Serializer};
use sha2::{Digest, Sha256};

use super::Shard;
use super::sidecars::write_json;
use crate::{Error, Input, OtherJob, Result};

/// The manifest of one shard.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Manifest {
    /// The shard, counted from 1, and the number of shards.
    pub shard: [usize; 2],
    /// Number of images of all shards.
    pub inputs: usize,
    /// SHA-256 of all inputs' paths and names; equal for all shards of a job.
    pub inputs_sha256: String,
    /// Program, weights and options.
    pub made_with: MadeWith,
    /// This shard's images.
    pub images: Vec<Entry>,
}

/// One image of a manifest.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Entry {
    /// Path of the input.
    #[serde(serialize_with = "as_text")]
    pub image: PathBuf,
    /// What its outputs' names begin with.
    pub name: String,
    /// Its state. A run that was killed may have done more: the sidecars are decisive.
    pub state: State,
    /// Why it failed.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub error: Option<String>,
}

/// Writes a path as text. If it is not UTF-8, the image fails, and the manifest must be able to report that.
fn as_text<S: Serializer>(path: &Path, serializer: S) -> Result<S::Ok, S::Error> {
    serializer.collect_str(&path.display())
}

/// The state of an image.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum State {
    /// Not begun, or not finished.
    Waiting,
    /// All outputs are written.
    Done,
    /// It could not be read or predicted.
    Failed,
}

impl Manifest {
    /// A manifest with nothing done; `mine` are this shard's images of `all` inputs.
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

    /// The manifest's path.
    #[must_use]
    pub fn path(&self, folder: &Path) -> PathBuf {
        let [index, count] = self.shard;
        folder.join(format!("predict-{index}-of-{count}.manifest.json"))
    }

    /// Number of images that are done.
    #[must_use]
    pub fn done(&self) -> usize {
        let is_done = |e: &&Entry| e.state == State::Done;
        self.images.iter().filter(is_done).count()
    }

    /// Writes the manifest atomically.
    ///
    /// # Errors
    /// A file that cannot be written.
    pub fn write(&self, folder: &Path) -> Result<()> {
        write_json(self, &self.path(folder))
    }

    /// All manifests in the folder. A file with such a name that is not a manifest is ignored.
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

    /// Refuses to work beside shards (of the same number) of another job: together they would process some inputs twice or not at all.
    ///
    /// # Errors
    /// [`Error::OtherJob`].
    pub fn check_against(&self, others: &[Self], folder: &Path) -> Result<()> {
        // A job of one shard need not agree with others: several commands may fill a folder.
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

    /// The images that a run of the same job had begun.
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
