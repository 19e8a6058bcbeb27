//! A folder of decoded frames: whole, and of what it says, or not there.

use crate::{Error, Result};
use serde::{Deserialize, Serialize};
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicU64, Ordering};
use std::time::UNIX_EPOCH;

/// What a folder of frames was made from.
#[derive(Debug, PartialEq, Eq, Serialize, Deserialize)]
pub(crate) struct Origin {
    bytes: u64,
    modified_ns: u128,
    frames: usize,
    /// Which of several streams of the file; `None` of a video.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    stream: Option<String>,
}

const ORIGIN: &str = "origin.json";

impl Origin {
    /// Of a file as it is now; of a folder, of all files in it but settings (`.toml`), which say nothing of the frames.
    ///
    /// # Errors
    /// [`Error::File`].
    pub(crate) fn of(place: &Path, frames: usize, stream: Option<String>) -> Result<Self> {
        let failed = |e| Error::file(place, e);
        let mut origin = Self {
            bytes: 0,
            modified_ns: 0,
            frames,
            stream,
        };
        if place.is_dir() {
            for entry in std::fs::read_dir(place).map_err(failed)? {
                let path = entry.map_err(failed)?.path();
                if path.is_file() && path.extension().is_none_or(|e| e != "toml") {
                    origin.add(&path)?;
                }
            }
        } else {
            origin.add(place)?;
        }
        Ok(origin)
    }

    fn add(&mut self, file: &Path) -> Result<()> {
        let about = std::fs::metadata(file).map_err(|e| Error::file(file, e))?;
        let modified = about
            .modified()
            .ok()
            .and_then(|t| t.duration_since(UNIX_EPOCH).ok());
        self.bytes += about.len();
        self.modified_ns = self.modified_ns.max(modified.map_or(0, |t| t.as_nanos()));
        Ok(())
    }

    /// `None` where the folder is no whole cache.
    fn read(cache: &Path) -> Option<Self> {
        let bytes = std::fs::read(cache.join(ORIGIN)).ok()?;
        serde_json::from_slice(&bytes).ok()
    }

    fn write(&self, folder: &Path) -> Result<()> {
        let path = folder.join(ORIGIN);
        let json = serde_json::to_vec(self).map_err(|e| Error::file(&path, e.into()))?;
        std::fs::write(&path, json).map_err(|e| Error::file(&path, e))
    }
}

/// The file of a frame, counted from 0.
pub(crate) fn frame_path(cache: &Path, index: u64) -> PathBuf {
    cache.join(format!("{index:010}.jpg"))
}

/// Has the frames made in a folder beside the cache, which is renamed when it is whole, unless the cache holds them already.
///
/// # Errors
/// Those of `make`; [`Error::File`].
pub(crate) fn keep<E: From<Error>>(
    cache: &Path,
    origin: &Origin,
    make: impl FnOnce(&Path) -> std::result::Result<(), E>,
) -> std::result::Result<(), E> {
    if Origin::read(cache).as_ref() == Some(origin) {
        return Ok(());
    }
    // Two threads of a process may decode the same, each for itself.
    static COUNT: AtomicU64 = AtomicU64::new(0);
    let mut name = cache.file_name().unwrap_or_default().to_owned();
    let count = COUNT.fetch_add(1, Ordering::Relaxed);
    name.push(format!(".part-{}-{count}", std::process::id()));
    let part = cache.with_file_name(name);
    // What cannot be replaced in the end is said before hours of decoding.
    let is_in_the_way = Origin::read(cache).is_none()
        && std::fs::read_dir(cache).is_ok_and(|mut files| files.next().is_some());
    if is_in_the_way {
        let why = "it holds other files, or a part of the frames: delete it";
        let why = std::io::Error::new(std::io::ErrorKind::AlreadyExists, why);
        return Err(Error::file(cache, why).into());
    }
    let filled = || -> std::result::Result<(), E> {
        // Of a process that had this number and was killed.
        if part.exists() {
            std::fs::remove_dir_all(&part).map_err(|e| Error::file(&part, e))?;
        }
        std::fs::create_dir_all(&part).map_err(|e| Error::file(&part, e))?;
        make(&part)?;
        origin.write(&part)?;
        // Of another video, or of this one before it changed.
        if Origin::read(cache).is_some_and(|old| old != *origin) {
            std::fs::remove_dir_all(cache).map_err(|e| Error::file(cache, e))?;
        }
        deepfusion_fs::publish_folder(&part, cache).map_err(|e| Error::file(cache, e))?;
        Ok(())
    };
    let made = filled();
    if made.is_err() {
        // Best effort: the error that counts is returned.
        let _ = std::fs::remove_dir_all(&part);
    }
    // Another process may have been quicker.
    if Origin::read(cache).as_ref() == Some(origin) {
        Ok(())
    } else {
        made
    }
}
