//! A folder of decoded frames. It is either complete and matches its description, or it does not exist.

use crate::{Error, Result};
use deepfusion_fs::PartialFolder;
use serde::{Deserialize, Serialize};
use std::path::{Path, PathBuf};
use std::time::UNIX_EPOCH;

/// The source of a folder of frames.
#[derive(Debug, PartialEq, Eq, Serialize, Deserialize)]
pub(crate) struct Origin {
    bytes: u64,
    modified_ns: u128,
    frames: usize,
    /// Which of several streams of the file; `None` for a video.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    stream: Option<String>,
    /// Width and height of the frames, if they differ from the file's.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    size: Option<(u32, u32)>,
    /// Path of the file, if its frames are kept elsewhere: frames of other files with the same name may be kept there. Frames beside
    /// their file may be moved with it.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    file: Option<String>,
}

const ORIGIN: &str = "origin.json";

impl Origin {
    /// The source as it is now: a file, or for a folder all its files except settings (`.toml`) and hidden ones, which do not affect
    /// the frames.
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
            file: None,
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

    /// The same source with frames of another size than the file's.
    pub(crate) fn with_size(self, size: Option<(u32, u32)>) -> Self {
        Self { size, ..self }
    }

    /// The same source with frames kept in `cache`.
    pub(crate) fn kept_in(self, cache: &Path, file: &Path) -> Self {
        let elsewhere = cache
            .parent()
            .is_some_and(|folder| !is_beside(file, folder));
        Self {
            file: elsewhere.then(|| real(file).to_string_lossy().into_owned()),
            ..self
        }
    }

    /// Whether both name their file, and the files differ.
    fn is_of_another_file(&self, other: &Self) -> bool {
        self.file.is_some() && other.file.is_some() && self.file != other.file
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

    /// `None` if the folder is not a complete cache.
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

/// Where the frames of a video, or of a stream in a recording, are kept in `folder`: as `<name>.frames` if `file` is in it,
/// else as `<name>-<hash>.frames`, with a hash of the file's path, as recordings with the same name may share a folder.
#[must_use]
pub fn frames_folder(folder: &Path, file: &Path, name: &str) -> PathBuf {
    if is_beside(file, folder) {
        return folder.join(format!("{name}.frames"));
    }
    let hash = fnv_1a(real(file).as_os_str().as_encoded_bytes());
    folder.join(format!("{name}-{hash:016x}.frames"))
}

/// Whether a folder has the frames of a video as it is now: they are then read from there, and nothing is written.
#[must_use]
pub fn holds_frames_of(folder: &Path, video: &Path) -> bool {
    Origin::read(folder).is_some_and(|kept| {
        let now = Origin::of(video, kept.frames, None);
        now.is_ok_and(|now| now.with_size(kept.size).kept_in(folder, video) == kept)
    })
}

/// The 64-bit hash FNV-1a: the same on every machine and in every version.
fn fnv_1a(bytes: &[u8]) -> u64 {
    bytes.iter().fold(0xCBF2_9CE4_8422_2325, |hash, byte| {
        (hash ^ u64::from(*byte)).wrapping_mul(0x0100_0000_01B3)
    })
}

/// Whether a file lies in a folder, however both are written.
fn is_beside(file: &Path, folder: &Path) -> bool {
    let own = file.parent().unwrap_or(Path::new("."));
    own == folder || real(own) == real(folder)
}

/// The path with links resolved; unchanged if it does not exist.
fn real(path: &Path) -> PathBuf {
    // The parent of a bare name is the empty path.
    let path = if path.as_os_str().is_empty() {
        Path::new(".")
    } else {
        path
    };
    let real = path.canonicalize().or_else(|_| std::path::absolute(path));
    real.unwrap_or_else(|_| path.to_owned())
}

/// Path of a frame's file; frames are counted from 0.
pub(crate) fn frame_path(cache: &Path, index: u64) -> PathBuf {
    cache.join(format!("{index:010}.jpg"))
}

/// Calls `make` to decode the frames into a temporary folder, which is renamed when it is complete. Does nothing if the cache
/// has them already.
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
    // A link is followed: frames are kept where there is space for them.
    let real = cache.canonicalize();
    let cache = real.as_deref().unwrap_or(cache);
    // A folder that cannot be replaced in the end is an error now, not after hours of decoding.
    let in_the_way = match Origin::read(cache) {
        Some(before) if before.is_of_another_file(origin) => {
            Some("the folder has the frames of another file")
        }
        Some(_) => None,
        None => std::fs::read_dir(cache)
            .is_ok_and(|mut files| files.next().is_some())
            .then_some("the folder has other files, or only some of the frames"),
    };
    if let Some(why) = in_the_way {
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
    // From another video, or from this one before it changed.
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

    /// A video of this length, and its cache.
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
    fn frames_are_decoded_once_and_again_for_another_video() {
        let folder = tempfile::tempdir().unwrap();
        let (cache, origin) = video(folder.path(), 3);
        let never = |_: &Path| -> Result<()> { panic!("the frames exist already") };
        keep(&cache, &origin, frame("first")).unwrap();
        keep(&cache, &origin, never).unwrap();
        let (cache, origin) = video(folder.path(), 4);
        keep(&cache, &origin, frame("second")).unwrap();
        let kept = std::fs::read_to_string(frame_path(&cache, 0)).unwrap();
        assert_eq!(kept, "second");
        assert_eq!(names(&cache), ["drive.mp4.frames"]);
    }

    /// Two drives whose cameras' files have the same name, with one folder for the frames of both.
    #[test]
    fn videos_with_the_same_name_share_no_frames() {
        let root = tempfile::tempdir().unwrap();
        let scratch = root.path().join("scratch");
        let kept = ["monday", "tuesday"].map(|day| {
            let folder = root.path().join(day);
            std::fs::create_dir(&folder).unwrap();
            let video = folder.join("front.mp4");
            std::fs::write(&video, "x").unwrap();
            let cache = frames_folder(&scratch, &video, "front.mp4");
            let origin = Origin::of(&video, 1, None).unwrap().kept_in(&cache, &video);
            keep(&cache, &origin, frame(day)).unwrap();
            (day, video, cache, origin)
        });
        for (day, video, cache, origin) in &kept {
            let never = |_: &Path| -> Result<()> { panic!("the frames exist already") };
            keep(cache, origin, never).unwrap();
            let text = std::fs::read_to_string(frame_path(cache, 0)).unwrap();
            assert_eq!(text, *day);
            // Neither creating the folder nor another spelling of the file's path changes its place.
            let other_name = root.path().join("monday/..").join(day).join("front.mp4");
            let again = frames_folder(&scratch, &other_name, "front.mp4");
            assert_eq!(again, *cache);
            // Beside the file, the file's name suffices, and both may be moved together.
            let own = video.parent().unwrap();
            let beside = frames_folder(own, video, "front.mp4");
            assert_eq!(beside, own.join("front.mp4.frames"));
            let moved = Origin::of(video, 1, None).unwrap();
            assert_eq!(moved.file, None);
            assert_eq!(moved.kept_in(&beside, video).file, None);
        }
        // A folder that names another file is not replaced.
        let [(.., cache, _), (.., other)] = &kept;
        let refused = keep(cache, other, frame("another")).unwrap_err();
        assert!(refused.to_string().contains("another file"), "{refused}");
    }

    #[test]
    fn frames_are_valid_until_their_video_changes() {
        let root = tempfile::tempdir().unwrap();
        let file = root.path().join("front.mp4");
        std::fs::write(&file, "x").unwrap();
        let places = [root.path().to_owned(), root.path().join("scratch")];
        let caches = places.map(|place| frames_folder(&place, &file, "front.mp4"));
        for cache in &caches {
            assert!(!holds_frames_of(cache, &file));
            let origin = Origin::of(&file, 1, None).unwrap().kept_in(cache, &file);
            keep(cache, &origin, frame("")).unwrap();
            assert!(holds_frames_of(cache, &file));
        }
        std::fs::write(&file, "longer").unwrap();
        for cache in &caches {
            assert!(!holds_frames_of(cache, &file));
        }
    }

    /// The values on the algorithm's own page.
    #[test]
    fn the_hash_is_fnv_1a() {
        assert_eq!(fnv_1a(b""), 0xCBF2_9CE4_8422_2325);
        assert_eq!(fnv_1a(b"a"), 0xAF63_DC4C_8601_EC8C);
        assert_eq!(fnv_1a(b"foobar"), 0x8594_4171_F739_67E8);
    }

    #[test]
    fn frames_of_older_versions_stay_valid_beside_their_video() {
        let folder = tempfile::tempdir().unwrap();
        let (_, origin) = video(folder.path(), 3);
        let text = serde_json::to_string(&origin).unwrap();
        let keys = ["bytes", "modified_ns", "frames"];
        let value: serde_json::Value = serde_json::from_str(&text).unwrap();
        assert_eq!(value.as_object().unwrap().len(), keys.len(), "{text}");
        assert!(keys.iter().all(|key| value.get(key).is_some()), "{text}");
    }

    #[cfg(unix)]
    #[test]
    fn a_linked_cache_is_filled_through_the_link() {
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
    fn a_failure_leaves_nothing_and_other_files_are_not_replaced() {
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
