//! Pictures to a video file.

use super::program::{WRITE, run};
use crate::{Error, Result, load_rgb};
use std::ffi::OsStr;
use std::path::Path;

/// A picture of a video, and for how long it is shown.
#[derive(Debug, Clone, PartialEq)]
pub struct Shown {
    /// Its name in the folder of all.
    pub file: String,
    /// Seconds, above 0.
    pub seconds: f64,
}

/// Makes a video of pictures that lie in a folder, with the user's ffmpeg: `name` (`*.mp4`) in the same folder, written
/// under another name and renamed when it is whole. Pictures of other sizes than the first are fitted into its
/// size; each is shown for its own time.
///
/// # Errors
/// [`Error::Program`] where ffmpeg is not installed or fails, [`Error::File`] where the folder cannot be written,
/// [`Error::Image`] where the first picture is none.
pub fn write_video(folder: &Path, pictures: &[Shown], name: &str) -> Result<()> {
    let Some(first) = pictures.first() else {
        return Ok(());
    };
    let size = load_rgb(&folder.join(&first.file))?.dimensions();
    let temporary = |what: usize| format!(".{name}.{}-{what}.partial", std::process::id());
    let (list, part) = (temporary(0), temporary(1));
    let made = std::fs::write(folder.join(&list), concat_list(pictures))
        .map_err(|e| Error::file(&folder.join(&list), e))
        .and_then(|()| encode(folder, &list, size, &part, name))
        .and_then(|()| {
            let path = folder.join(name);
            std::fs::rename(folder.join(&part), &path).map_err(|e| Error::file(&path, e))
        });
    for temporary in [list, part] {
        // Best effort: what counts is whether the video was made.
        let _ = std::fs::remove_file(folder.join(temporary));
    }
    made
}

/// Whether ffmpeg can be run at all, to know before hours of work.
///
/// # Errors
/// [`Error::Program`] where it is not installed.
pub fn can_write_video(path: &Path) -> Result<()> {
    run("ffmpeg", &["-version"], (path, WRITE), Path::new(".")).map(|_| ())
}

fn encode(folder: &Path, list: &str, size: (u32, u32), part: &str, name: &str) -> Result<()> {
    // Encoders of 4:2:0 want even sizes.
    let [w, h] = [size.0, size.1].map(|s| s.next_multiple_of(2));
    let fit = format!(
        "scale={w}:{h}:force_original_aspect_ratio=decrease,pad={w}:{h}:(ow-iw)/2:(oh-ih)/2,setsar=1"
    );
    let with = |mode: &str| {
        let arguments: [&OsStr; 21] = [
            "-v".as_ref(),
            "error".as_ref(),
            "-y".as_ref(),
            "-f".as_ref(),
            "concat".as_ref(),
            "-safe".as_ref(),
            "0".as_ref(),
            "-i".as_ref(),
            list.as_ref(),
            "-vf".as_ref(),
            fit.as_ref(),
            "-pix_fmt".as_ref(),
            "yuv420p".as_ref(),
            mode.as_ref(),
            "vfr".as_ref(),
            "-movflags".as_ref(),
            "+faststart".as_ref(),
            "-an".as_ref(),
            "-f".as_ref(),
            "mp4".as_ref(),
            part.as_ref(),
        ];
        run("ffmpeg", &arguments, (&folder.join(name), WRITE), folder)
    };
    // Before ffmpeg 5.1 the option had another name.
    with("-fps_mode").or_else(|_| with("-vsync")).map(|_| ())
}

/// ffmpeg's list of files; of the last one it would forget the time, were it not named again.
fn concat_list(pictures: &[Shown]) -> String {
    let file = |p: &Shown| format!("file '{}'\n", p.file.replace('\'', r"'\''"));
    let mut text = String::from("ffconcat version 1.0\n");
    for picture in pictures {
        text += &format!("{}duration {:.6}\n", file(picture), picture.seconds);
    }
    text + &pictures.last().map(file).unwrap_or_default()
}

/// How long each frame of a recording is shown, from when they were taken: until the next one, 0.1 s where that is not
/// known or not later, and no longer than a second.
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
            Some(1.04),
            Some(1.04),
            None,
            Some(2.0),
            Some(9.0),
        ];
        let seconds = shown_for(&times);
        let expected = [0.04, 0.1, 0.1, 0.1, 1.0, 1.0];
        assert!(
            seconds
                .iter()
                .zip(expected)
                .all(|(a, b)| (a - b).abs() < 1e-9),
            "{seconds:?}"
        );
        assert_eq!(shown_for(&[]), [] as [f64; 0]);
        assert_eq!(shown_for(&[None]), [0.1]);
    }

    #[test]
    fn names_with_quotes_stay_names() {
        let list = concat_list(&[Shown {
            file: "it's.png".into(),
            seconds: 0.04,
        }]);
        let expected =
            "ffconcat version 1.0\nfile 'it'\\''s.png'\nduration 0.040000\nfile 'it'\\''s.png'\n";
        assert_eq!(list, expected);
    }
}
