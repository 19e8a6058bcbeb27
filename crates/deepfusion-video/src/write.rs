//! Writes pictures as a video file.

use crate::program::{outcome, run, with_either_option_name};
use crate::{Error, ProgramProblem, ProgramTask, Result};
use deepfusion_fs::PartialFolder;
use image::ImageReader;
use std::ffi::OsStr;
use std::path::Path;

/// A picture of a video, with the time for which it is shown.
#[derive(Debug, Clone, PartialEq)]
pub struct VideoPicture {
    /// Its file name in the folder.
    pub file: String,
    /// Duration in seconds, above 0.
    pub seconds: f64,
}

/// ffmpeg rounds the times of a list to 25ths of a second. So it gets a thousand times the durations, and scales them back.
const FINER: f64 = 1000.0;

/// Makes a video of pictures (PNG) in a folder, with the user's ffmpeg: `name` (`*.mp4`) in the same folder, written
/// elsewhere and moved there when it is complete. Pictures whose size differs from the first one's are fitted into its size; each is shown
/// for its own time. Without pictures no video is written.
///
/// # Errors
/// [`Error::Program`] if ffmpeg is not installed, or fails at any of the pictures; [`Error::File`] if the folder
/// cannot be written; [`Error::Picture`] if the first picture cannot be read.
pub fn write_video(folder: &Path, pictures: &[VideoPicture], name: &str) -> Result<()> {
    let Some(first) = pictures.first() else {
        return Ok(());
    };
    let size = picture_size(&folder.join(&first.file))?;
    let path = folder.join(name);
    let failed = |e| Error::file(&path, e);
    // ffmpeg gives colons and percent signs in names another meaning. So it reads and writes in a temporary folder, of
    // which only the video is kept.
    let aside = PartialFolder::beside(&path).map_err(failed)?;
    let list = concat_list(pictures, |i, picture| {
        take(&folder.join(&picture.file), aside.path(), i)
    })?;
    std::fs::write(aside.path().join(LIST), list).map_err(failed)?;
    encode(aside.path(), size, &path)?;
    deepfusion_fs::publish(&aside.path().join(PART), &path).map_err(failed)
}

/// Width and height of a picture, whatever the ending of its name.
fn picture_size(path: &Path) -> Result<(u32, u32)> {
    let failed = |e| Error::file(path, e);
    let reader = ImageReader::open(path).map_err(failed)?;
    let reader = reader.with_guessed_format().map_err(failed)?;
    reader.into_dimensions().map_err(|source| Error::Picture {
        path: path.to_owned(),
        source,
    })
}

/// Checks that ffmpeg can be run, before hours of work.
///
/// # Errors
/// [`Error::Program`] if it is not installed.
pub fn can_write_video(path: &Path) -> Result<()> {
    run(
        "ffmpeg",
        &["-version"],
        (path, ProgramTask::Write),
        Path::new("."),
    )
    .map(|_| ())
}

const LIST: &str = "list";
const PART: &str = "part";

/// Puts a picture into a folder, and returns its name there.
fn take(picture: &Path, folder: &Path, number: usize) -> Result<String> {
    let name = format!("{number:08}.png");
    let path = folder.join(&name);
    // Not every file system has links.
    std::fs::hard_link(picture, &path)
        .or_else(|_| std::fs::copy(picture, &path).map(|_| ()))
        .map_err(|e| Error::file(picture, e))?;
    Ok(name)
}

fn encode(aside: &Path, size: (u32, u32), video: &Path) -> Result<()> {
    // Encoders of 4:2:0 need even sizes.
    let [w, h] = [size.0, size.1].map(|s| s.next_multiple_of(2));
    let filter = format!(
        "settb=1/90000,setpts=PTS/{FINER},\
         scale={w}:{h}:force_original_aspect_ratio=decrease,pad={w}:{h}:(ow-iw)/2:(oh-ih)/2,setsar=1"
    );
    let with = |mode: &str| {
        let arguments: [&OsStr; 23] = [
            "-v".as_ref(),
            "error".as_ref(),
            "-y".as_ref(),
            "-f".as_ref(),
            "concat".as_ref(),
            "-safe".as_ref(),
            "0".as_ref(),
            "-i".as_ref(),
            LIST.as_ref(),
            "-vf".as_ref(),
            filter.as_ref(),
            "-pix_fmt".as_ref(),
            "yuv420p".as_ref(),
            mode.as_ref(),
            "vfr".as_ref(),
            "-enc_time_base".as_ref(),
            "1:90000".as_ref(),
            "-movflags".as_ref(),
            "+faststart".as_ref(),
            "-an".as_ref(),
            "-f".as_ref(),
            "mp4".as_ref(),
            PART.as_ref(),
        ];
        outcome(
            "ffmpeg",
            &arguments,
            (video, ProgramTask::Write),
            aside,
            None,
        )
    };
    let done = with_either_option_name(with)?.succeeded("ffmpeg", (video, ProgramTask::Write))?;
    // ffmpeg continues after a picture that it cannot read, or ends there, and reports success in both cases.
    if done.complaint.is_empty() {
        Ok(())
    } else {
        Err(Error::Program {
            path: video.to_owned(),
            program: "ffmpeg",
            problem: ProgramProblem::StoppedEarly {
                message: done.complaint,
            },
        })
    }
}

/// ffmpeg's list of files, each with the name that `file` returns. The last one is listed twice, as ffmpeg would ignore its
/// duration otherwise.
fn concat_list(
    pictures: &[VideoPicture],
    mut file: impl FnMut(usize, &VideoPicture) -> Result<String>,
) -> Result<String> {
    let mut text = String::from("ffconcat version 1.0\n");
    let mut last = String::new();
    for (i, picture) in pictures.iter().enumerate() {
        last = format!("file {}\n", file(i, picture)?);
        text += &format!("{last}duration {:.6}\n", FINER * picture.seconds);
    }
    Ok(text + &last)
}

/// How long each frame of a recording is shown, from the times of the frames: until the next one, or 0.1 s if that time is not
/// known or not later; a second at most.
#[must_use]
pub fn shown_for(times_s: &[Option<f64>]) -> Vec<f64> {
    const UNKNOWN_S: f64 = 0.1;
    const LONGEST_S: f64 = 1.0;
    let until = |pair: &[Option<f64>]| match pair {
        [Some(now), Some(next)] if next > now => (next - now).min(LONGEST_S),
        _ => UNKNOWN_S,
    };
    let mut seconds: Vec<f64> = times_s.windows(2).map(until).collect();
    if !times_s.is_empty() {
        seconds.push(seconds.last().copied().unwrap_or(UNKNOWN_S));
    }
    seconds
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn frames_are_shown_until_the_next() {
        let times = [
            Some(1.0),
            Some(1.25),
            Some(1.25),
            None,
            Some(2.0),
            Some(9.0),
        ];
        assert_eq!(shown_for(&times), [0.25, 0.1, 0.1, 0.1, 1.0, 1.0]);
        assert_eq!(shown_for(&[]), [] as [f64; 0]);
        assert_eq!(shown_for(&[None]), [0.1]);
    }

    #[test]
    fn the_last_picture_is_listed_twice() {
        let shown = |file: &str| VideoPicture {
            file: file.into(),
            seconds: 0.04,
        };
        let pictures = [shown("a"), shown("b")];
        let list = concat_list(&pictures, |i, picture| Ok(format!("{i}{}", picture.file)));
        let expected = "ffconcat version 1.0\nfile 0a\nduration 40.000000\nfile 1b\nduration 40.000000\nfile 1b\n";
        assert_eq!(list.unwrap(), expected);
    }
}
