//! A video's frames as files.
//!
//! Training reads frames in random order, which a video cannot give: every jump decodes from the last
//! key frame. So all frames are decoded once, into `<video>.frames` in a folder that the caller names, as
//! JPEGs of ffmpeg's best quality but one; the folder can be deleted at any time. It is filled under another name and
//! renamed when it is whole.

use crate::probe::{Probed, probe};
use crate::program::{READ, in_either_words, run};
use crate::{Error, Result};
use serde::{Deserialize, Serialize};
use std::ffi::OsStr;
use std::path::{Path, PathBuf};
use std::sync::Mutex;
use std::time::UNIX_EPOCH;

/// A video's frames: counted when it is opened, decoded when the first of them is asked for.
#[derive(Debug)]
pub struct VideoFrames {
    file: PathBuf,
    cache: PathBuf,
    probed: Probed,
    /// Whether the cache is complete; held while it is made.
    decoded: Mutex<bool>,
}

impl VideoFrames {
    /// Counts the frames of a video with ffprobe. Its frames will be kept in `<video>.frames` in `folder`.
    ///
    /// # Errors
    /// [`Error::Program`].
    pub fn open(file: &Path, folder: &Path) -> Result<Self> {
        let name = file.file_name().unwrap_or_default().to_string_lossy();
        Ok(Self {
            probed: probe(file)?,
            cache: folder.join(format!("{name}.frames")),
            file: file.to_owned(),
            decoded: Mutex::new(false),
        })
    }

    /// The video.
    #[must_use]
    pub fn file(&self) -> &Path {
        &self.file
    }

    /// How many frames there are.
    #[must_use]
    pub fn count(&self) -> usize {
        self.probed.frames
    }

    /// Width and height of the frames as shown, the recorder's rotation applied.
    #[must_use]
    pub fn size(&self) -> (u32, u32) {
        self.probed.size
    }

    /// The frames' times in order, in nanoseconds; `None` where the file has none.
    #[must_use]
    pub fn times_ns(&self) -> Option<&[i64]> {
        self.probed.times_ns.as_deref()
    }

    /// When the recorder says that the video was made, in nanoseconds since 1970: its first frame of some recorders, its last
    /// of others.
    #[must_use]
    pub fn created_ns(&self) -> Option<i64> {
        self.probed.created_ns
    }

    /// The JPEG of a frame, counted from 0; the first call decodes the whole video, unless that was done before.
    ///
    /// # Errors
    /// [`Error::Program`] where the video cannot be decoded, [`Error::File`] where its frames cannot be kept.
    pub fn frame(&self, index: u64) -> Result<PathBuf> {
        // A thread that failed while decoding left nothing behind.
        let mut decoded = self.decoded.lock().unwrap_or_else(|e| e.into_inner());
        if !*decoded {
            ensure(&self.file, &self.cache, self.probed.frames)?;
            *decoded = true;
        }
        Ok(frame_path(&self.cache, index))
    }
}

/// Which video a folder of frames was made from.
#[derive(Debug, PartialEq, Eq, Serialize, Deserialize)]
struct Origin {
    bytes: u64,
    modified_ns: u128,
    frames: usize,
}

const ORIGIN: &str = "origin.json";

/// The file of a frame, counted from 0.
fn frame_path(cache: &Path, index: u64) -> PathBuf {
    cache.join(format!("{index:010}.jpg"))
}

/// Decodes the video, unless the folder holds its frames already.
///
/// # Errors
/// [`Error::Program`], [`Error::File`].
fn ensure(video: &Path, cache: &Path, frames: usize) -> Result<()> {
    let origin = Origin::of(video, frames)?;
    if Origin::read(cache).as_ref() == Some(&origin) {
        return Ok(());
    }
    let part = cache.with_extension(format!("part-{}", std::process::id()));
    let made = decode(video, &part, &origin).and_then(|()| {
        // Of another video, or of this one before it changed.
        let old = Origin::read(cache).is_some();
        if old {
            std::fs::remove_dir_all(cache).map_err(|e| Error::file(cache, e))?;
        }
        deepfusion_fs::publish_folder(&part, cache).map_err(|e| Error::file(cache, e))
    });
    if made.is_err() {
        // Best effort: the error that counts is told.
        let _ = std::fs::remove_dir_all(&part);
    }
    // Another process may have been quicker.
    if Origin::read(cache).as_ref() == Some(&origin) {
        Ok(())
    } else {
        made
    }
}

fn decode(video: &Path, part: &Path, origin: &Origin) -> Result<()> {
    std::fs::create_dir_all(part).map_err(|e| Error::file(part, e))?;
    // One file a frame: none doubled or dropped to keep a rate.
    in_either_words(|mode| ffmpeg(video, part, mode))?;
    let written = std::fs::read_dir(part)
        .map_err(|e| Error::file(part, e))?
        .count();
    if written != origin.frames {
        return Err(Error::Program {
            path: video.to_owned(),
            program: "ffmpeg",
            problem: format!("decoded {written} frames, ffprobe counts {}", origin.frames),
            remedy: "part of the video is damaged: write it anew, such as ffmpeg -i OLD -c:v libx264 -crf 12 NEW.mp4",
        });
    }
    let path = part.join(ORIGIN);
    let json = serde_json::to_vec(origin).map_err(|e| Error::file(&path, e.into()))?;
    std::fs::write(&path, json).map_err(|e| Error::file(&path, e))
}

fn ffmpeg(video: &Path, part: &Path, mode: &str) -> Result<Vec<u8>> {
    let arguments: [&OsStr; 15] = [
        "-v".as_ref(),
        "error".as_ref(),
        "-y".as_ref(),
        "-i".as_ref(),
        video.as_os_str(),
        "-map".as_ref(),
        "0:v:0".as_ref(),
        mode.as_ref(),
        "passthrough".as_ref(),
        "-q:v".as_ref(),
        "2".as_ref(),
        "-start_number".as_ref(),
        "0".as_ref(),
        "-an".as_ref(),
        // Within the folder: a `%` in its own path would count as a number's place.
        "%010d.jpg".as_ref(),
    ];
    run("ffmpeg", &arguments, (video, READ), part)
}

impl Origin {
    fn of(video: &Path, frames: usize) -> Result<Self> {
        let about = std::fs::metadata(video).map_err(|e| Error::file(video, e))?;
        let modified = about
            .modified()
            .ok()
            .and_then(|t| t.duration_since(UNIX_EPOCH).ok());
        Ok(Self {
            bytes: about.len(),
            modified_ns: modified.map_or(0, |t| t.as_nanos()),
            frames,
        })
    }

    /// `None` where the folder is no whole cache.
    fn read(cache: &Path) -> Option<Self> {
        let bytes = std::fs::read(cache.join(ORIGIN)).ok()?;
        serde_json::from_slice(&bytes).ok()
    }
}
