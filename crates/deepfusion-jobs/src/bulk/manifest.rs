//! What a shard has to do and has done, in the output folder: `predict-I-of-N.manifest.json`.

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
    #[serde(serialize_with = "as_text")]
    pub image: PathBuf,
    /// What its outputs' names begin with.
    pub name: String,
    /// How far it is. A run that was killed may have done more than this says: the sidecars tell.
    pub state: State,
    /// Why it failed.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub error: Option<String>,
}

/// A path as text: of one that is none, the image fails, and the manifest is to say so.
fn as_text<S: Serializer>(path: &Path, serializer: S) -> Result<S::Ok, S::Error> {
    serializer.collect_str(&path.display())
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
