//! A video's frames as files.
//!
//! Training reads frames in random order, which a video cannot give: every jump decodes from the last
//! key frame. So all frames are decoded once, into `<video>.frames` in a folder that the caller names
//! ([`frames_folder`]), as JPEGs of ffmpeg's best quality but one; the folder can be deleted at any time. It is filled under
//! another name and renamed when it is whole.

use crate::cache::{Origin, frame_path, frames_folder, keep};
use crate::decoded::Decoded;
use crate::probe::{Probed, probe};
use crate::program::{Printed, in_either_words, outcome};
use crate::{Error, ProgramProblem, ProgramTask, Result};
use std::ffi::OsStr;
use std::path::{Path, PathBuf};

/// A video's frames: counted when it is opened, decoded when the first of them is asked for.
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

    /// Width and height of the frames as shown, the recorder's rotation applied, and pixels that are not square made so.
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
    /// [`Error::Program`] where the video cannot be decoded, [`Error::File`] where its frames cannot be kept; [`Error::NotDecoded`] in the same
    /// words for every frame that is asked for after that.
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
    // One file a frame: none doubled or dropped to keep a rate.
    in_either_words(|mode| ffmpeg(video, part, mode, scale.as_deref()))?
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
    // Within the folder: a `%` in its own path would count as a number's place.
    arguments.push("%010d.jpg".as_ref());
    outcome("ffmpeg", &arguments, (video, ProgramTask::Read), part, None)
}
