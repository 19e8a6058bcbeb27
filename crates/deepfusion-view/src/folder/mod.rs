//! A folder of results, refreshed as it grows.

mod entry;
mod frame;
mod index;
mod listing;
mod order;
mod problem;
mod small_files;
mod summary;

use std::path::{Path, PathBuf};
use std::sync::{Mutex, MutexGuard, PoisonError};

use deepfusion_fs::FileError;

pub(crate) use entry::{Entry, FrameFile};
pub(crate) use frame::{Track, details_of, picture_of, targets_of};
pub use problem::FrameProblem;
pub(crate) use small_files::SmallFiles;
#[cfg(feature = "rerun")]
pub(crate) use summary::Summary;

use self::index::Index;
use self::listing::Listing;
use crate::training;
use crate::{Error, FolderKind, Result};

/// A folder whose results are shown.
#[derive(Debug)]
pub struct Folder {
    path: PathBuf,
    kind: FolderKind,
    listing: Mutex<Listing>,
}

impl Folder {
    /// Opens a folder that `predict` or `perceive` wrote (or still writes), or a run of `train`.
    ///
    /// # Errors
    /// [`Error::NoSuchFolder`], [`Error::NotAFolder`], [`Error::File`] if it cannot be listed, [`Error::NothingToShow`].
    pub fn open(path: &Path) -> Result<Self> {
        match std::fs::metadata(path) {
            Err(e) if e.kind() == std::io::ErrorKind::NotFound => {
                return Err(Error::NoSuchFolder {
                    path: path.to_owned(),
                });
            }
            Err(e) => return Err(Error::file(path, e)),
            Ok(meta) if !meta.is_dir() => {
                return Err(Error::NotAFolder {
                    path: path.to_owned(),
                });
            }
            Ok(_) => {}
        }
        let mut listing = Listing::new(path);
        listing.refresh().map_err(|e| Error::file(path, e))?;
        let kind = if !listing.is_empty() {
            FolderKind::Predictions
        } else if training::is_run(path) {
            FolderKind::Training
        } else {
            return Err(Error::NothingToShow {
                path: path.to_owned(),
            });
        };
        Ok(Self {
            path: path.to_owned(),
            kind,
            listing: Mutex::new(listing),
        })
    }

    /// The folder's path.
    #[must_use]
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// Number of frames when the folder was last listed; 0 for a training run.
    #[must_use]
    pub fn frames(&self) -> usize {
        self.listing().len()
    }

    /// Whether the folder is a training run without predictions.
    #[must_use]
    pub fn is_training_run(&self) -> bool {
        self.kind == FolderKind::Training
    }

    pub(crate) fn kind(&self) -> FolderKind {
        self.kind
    }

    /// The folder's name: the last part of its path.
    pub(crate) fn name(&self) -> String {
        let full = std::fs::canonicalize(&self.path).unwrap_or_else(|_| self.path.clone());
        full.file_name().map_or_else(
            || full.display().to_string(),
            |n| n.to_string_lossy().into_owned(),
        )
    }

    /// The list of frames for a client that has the `known` version of it, refreshed.
    pub(crate) fn index(&self, known: Option<u64>) -> Index {
        let mut listing = self.listing();
        let refreshed = listing.refresh();
        let failure = refreshed
            .err()
            .map(|e| FileError::new(&self.path, e).to_string());
        listing.summarise();
        listing.index(known, failure)
    }

    /// The frame of this name, if it was listed.
    pub(crate) fn entry(&self, name: &str) -> Option<Entry> {
        self.listing().entry(name).cloned()
    }

    /// Frames in order, from the given place.
    pub(crate) fn entries(&self, from: usize, count: usize) -> Vec<Entry> {
        self.listing().range(from, count)
    }

    fn listing(&self) -> MutexGuard<'_, Listing> {
        // No method leaves a listing half changed, so it is valid after a panic elsewhere.
        self.listing.lock().unwrap_or_else(PoisonError::into_inner)
    }
}
