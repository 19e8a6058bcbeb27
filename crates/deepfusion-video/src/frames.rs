//! A video's frames as files.
//!
//! Training reads frames in random order, which a video cannot give: every jump decodes from the last
//! key frame. So all frames are decoded once, into `<video>.frames` in a folder that the caller chooses
//! ([`frames_folder`]), as JPEGs of ffmpeg's second best quality. The folder can be deleted at any time. It is filled under
//! a temporary name and renamed when it is complete.

use crate::cache::{Origin, frame_path, frames_folder, keep};
use crate::decoded::Decoded;
use crate::probe::{Probed, probe};
use crate::program::{Printed, outcome, with_either_option_name};
use crate::{Error, ProgramProblem, ProgramTask, Result};
use std::ffi::OsStr;
use std::path::{Path, PathBuf};

/// A video's frames: counted when it is opened, decoded when the first of them is requested.
#[derive(Debug)]
pub struct VideoFrames {
    file: PathBuf,
    cache: PathBuf,
    probed: Probed,
    decoded: Decoded,
}

impl VideoFrames {
    /// Counts the frames of a video with ffprobe. Its frames will be kept in `folder`, under the name that
    /// [`frames_folder`] gives.
    ///
    /// # Errors
    /// [`Error::Program`].
    pub fn open(file: &Path, folder: &Path) -> Result<Self> {
        let name = file.file_name().unwrap_or_default().to_string_lossy();
        let cache = frames_folder(folder, file, &name);
        // The programs run in other folders.
        let absolute = |path: &Path| std::path::absolute(path).map_err(|e| Error::file(path, e));
        let file = absolute(file)?;
        Ok(Self {
            probed: probe(&file)?,
            cache: absolute(&cache)?,
            file,
            decoded: Decoded::default(),
        })
    }

    /// Path of the video.
    #[must_use]
    pub fn file(&self) -> &Path {
        &self.file
    }

    /// Number of frames.
    #[must_use]
    pub fn count(&self) -> usize {
        self.probed.frames
    }

    /// Width and height of the frames as shown, with the recorder's rotation applied and non-square pixels made square.
    #[must_use]
    pub fn size(&self) -> (u32, u32) {
        self.probed.size
    }

    /// The frames' times in order, in nanoseconds; `None` if the file has none.
    #[must_use]
    pub fn times_ns(&self) -> Option<&[i64]> {
        self.probed.times_ns.as_deref()
    }

    /// The video's creation time according to the recorder, in nanoseconds since 1970: some recorders write that of the first frame, others
    /// that of the last.
    #[must_use]
    pub fn created_ns(&self) -> Option<i64> {
        self.probed.created_ns
    }

    /// Path of a frame's JPEG, counted from 0; the first call decodes the whole video, unless that was done before.
    ///
    /// # Errors
    /// [`Error::Program`] if the video cannot be decoded, [`Error::File`] if its frames cannot be kept; [`Error::NotDecoded`] with the same
    /// message for every frame that is requested after that.
    pub fn frame(&self, index: u64) -> Result<PathBuf> {
        self.decoded.once(|| self.decode_all())?;
        Ok(frame_path(&self.cache, index))
    }

    fn decode_all(&self) -> Result<()> {
        let frames = self.probed.frames;
        let size = (!self.probed.square).then_some(self.probed.size);
        let origin = Origin::of(&self.file, frames, None)?
            .with_size(size)
            .kept_in(&self.cache, &self.file);
        keep(&self.cache, &origin, |part| {
            decode(&self.file, part, &self.probed)
        })
    }
}

fn decode(video: &Path, part: &Path, probed: &Probed) -> Result<()> {
    let frames = probed.frames;
    let (width, height) = probed.size;
    let scale = (!probed.square).then(|| format!("scale={width}:{height},setsar=1"));
    // One file per frame: none is duplicated or dropped to keep a rate.
    with_either_option_name(|mode| ffmpeg(video, part, mode, scale.as_deref()))?
        .succeeded("ffmpeg", (video, ProgramTask::Read))?;
    let written = std::fs::read_dir(part)
        .map_err(|e| Error::file(part, e))?
        .count();
    if written != frames {
        return Err(Error::Program {
            path: video.to_owned(),
            program: "ffmpeg",
            problem: ProgramProblem::Frames {
                decoded: written,
                counted: frames,
            },
        });
    }
    Ok(())
}

fn ffmpeg(video: &Path, part: &Path, mode: &str, filter: Option<&str>) -> Result<Printed> {
    let mut arguments: Vec<&OsStr> = vec![
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
    ];
    if let Some(filter) = filter {
        arguments.extend([OsStr::new("-vf"), filter.as_ref()]);
    }
    // Relative to the folder: a `%` in its own path would count as a placeholder for the number.
    arguments.push("%010d.jpg".as_ref());
    outcome("ffmpeg", &arguments, (video, ProgramTask::Read), part, None)
}
