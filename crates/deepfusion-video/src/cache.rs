//! A folder of decoded frames: whole, and of what it says, or not there.

use crate::{Error, Result};
use deepfusion_fs::PartialFolder;
use serde::{Deserialize, Serialize};
use std::path::{Path, PathBuf};
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
    /// Width and height of the frames where they are not as the file has them.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    size: Option<(u32, u32)>,
}

const ORIGIN: &str = "origin.json";

impl Origin {
    /// Of a file as it is now; of a folder, of all files in it but settings (`.toml`) and hidden ones, which say nothing of the frames.
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
            size: None,
        };
        if place.is_dir() {
            for entry in std::fs::read_dir(place).map_err(failed)? {
                let entry = entry.map_err(failed)?;
                let path = entry.path();
                let hidden = entry.file_name().as_encoded_bytes().starts_with(b".");
                if !hidden && path.is_file() && path.extension().is_none_or(|e| e != "toml") {
                    origin.add(&path)?;
                }
            }
        } else {
            origin.add(place)?;
        }
        Ok(origin)
    }

    /// The same with frames of another size than the file has.
    pub(crate) fn with_size(self, size: Option<(u32, u32)>) -> Self {
        Self { size, ..self }
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
    // Of a link, what it leads to: frames are kept where there is room for them.
    let real = cache.canonicalize();
    let cache = real.as_deref().unwrap_or(cache);
    // What cannot be replaced in the end is said before hours of decoding.
    let is_in_the_way = Origin::read(cache).is_none()
        && std::fs::read_dir(cache).is_ok_and(|mut files| files.next().is_some());
    if is_in_the_way {
        let why = "it holds other files, or a part of the frames: delete it";
        let why = std::io::Error::new(std::io::ErrorKind::AlreadyExists, why);
        return Err(Error::file(cache, why).into());
    }
    let made = fill(cache, origin, make);
    // Another process or thread may have been quicker.
    if Origin::read(cache).as_ref() == Some(origin) {
        Ok(())
    } else {
        made
    }
}

fn fill<E: From<Error>>(
    cache: &Path,
    origin: &Origin,
    make: impl FnOnce(&Path) -> std::result::Result<(), E>,
) -> std::result::Result<(), E> {
    let failed = |e| Error::file(cache, e);
    let part = PartialFolder::beside(cache).map_err(failed)?;
    make(part.path())?;
    origin.write(part.path())?;
    // Of another video, or of this one before it changed.
    let is_old = Origin::read(cache).is_some_and(|old| old != *origin);
    let committed = if is_old {
        part.commit_replacing()
    } else {
        part.commit()
    };
    Ok(committed.map_err(failed)?)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A video that is so long, and its cache.
    fn video(folder: &Path, bytes: usize) -> (PathBuf, Origin) {
        let video = folder.join("drive.mp4");
        std::fs::write(&video, vec![0_u8; bytes]).unwrap();
        let origin = Origin::of(&video, 1, None).unwrap();
        (folder.join("cache/drive.mp4.frames"), origin)
    }

    fn frame(text: &str) -> impl FnOnce(&Path) -> Result<()> {
        move |part| std::fs::write(frame_path(part, 0), text).map_err(|e| Error::file(part, e))
    }

    fn names(cache: &Path) -> Vec<String> {
        let entries = std::fs::read_dir(cache.parent().unwrap()).unwrap();
        entries
            .map(|e| e.unwrap().file_name().into_string().unwrap())
            .collect()
    }

    #[test]
    fn frames_are_made_once_and_anew_for_another_video() {
        let folder = tempfile::tempdir().unwrap();
        let (cache, origin) = video(folder.path(), 3);
        let never = |_: &Path| -> Result<()> { panic!("they are there") };
        keep(&cache, &origin, frame("first")).unwrap();
        keep(&cache, &origin, never).unwrap();
        let (cache, origin) = video(folder.path(), 4);
        keep(&cache, &origin, frame("second")).unwrap();
        let kept = std::fs::read_to_string(frame_path(&cache, 0)).unwrap();
        assert_eq!(kept, "second");
        assert_eq!(names(&cache), ["drive.mp4.frames"]);
    }

    #[cfg(unix)]
    #[test]
    fn a_link_leads_to_where_there_is_room() {
        let folder = tempfile::tempdir().unwrap();
        let (cache, origin) = video(folder.path(), 3);
        let disk = folder.path().join("disk/frames");
        std::fs::create_dir_all(&disk).unwrap();
        std::fs::create_dir_all(cache.parent().unwrap()).unwrap();
        std::os::unix::fs::symlink(&disk, &cache).unwrap();
        keep(&cache, &origin, frame("there")).unwrap();
        assert!(cache.is_symlink() && frame_path(&disk, 0).is_file());
        let (_, origin) = video(folder.path(), 4);
        keep(&cache, &origin, frame("anew")).unwrap();
        let kept = std::fs::read_to_string(frame_path(&disk, 0)).unwrap();
        assert_eq!((kept.as_str(), cache.is_symlink()), ("anew", true));
    }

    #[test]
    fn what_fails_leaves_nothing_and_other_files_are_not_replaced() {
        let folder = tempfile::tempdir().unwrap();
        let (cache, origin) = video(folder.path(), 3);
        let fails = |part: &Path| -> Result<()> {
            std::fs::write(frame_path(part, 0), "half").unwrap();
            Err(Error::file(part, std::io::ErrorKind::StorageFull.into()))
        };
        keep(&cache, &origin, fails).unwrap_err();
        assert!(!cache.parent().unwrap().exists());
        std::fs::create_dir_all(&cache).unwrap();
        std::fs::write(cache.join("mine"), "x").unwrap();
        let refused = keep(&cache, &origin, frame("new")).unwrap_err();
        assert!(refused.to_string().contains("other files"), "{refused}");
        assert!(cache.join("mine").exists());
    }
}
