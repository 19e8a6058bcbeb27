//! Makes videos from the pictures of a run, one for each recording.

use std::path::{Path, PathBuf};
use std::sync::Arc;

use deepfusion_video::{VideoPicture, shown_for, write_video};

use super::manifest::Manifest;
use crate::files::UniqueNames;
use crate::{Error, Input, Result};

/// The ending of a video's name.
pub const VIDEO_ENDING: &str = "_video.mp4";

/// The name of the video of images that belong to no recording.
const IMAGES: &str = "images";

/// Checks that the videos of the inputs may be written: they may only replace files left by runs of the same inputs, as recorded in a
/// manifest.
///
/// # Errors
/// [`Error::Exists`].
pub(super) fn make_room(
    folder: &Path,
    inputs: &[Input],
    ours: &Manifest,
    before: &[Manifest],
) -> Result<()> {
    if before.iter().any(|m| m.inputs_sha256 == ours.inputs_sha256) {
        return Ok(());
    }
    for (name, _) in videos(inputs) {
        let path = folder.join(name);
        if path.exists() {
            return Err(Error::Exists { path });
        }
    }
    Ok(())
}

/// Writes one video for each recording among the inputs, and one for the images that belong to none, from the pictures in `folder` whose
/// names end with `pictures`. Returns the videos, each with its number of frames.
///
/// # Errors
/// ffmpeg's error.
pub fn write_videos(
    folder: &Path,
    inputs: &[Input],
    pictures: &str,
) -> Result<Vec<(PathBuf, usize)>> {
    let mut written = Vec::new();
    for (name, same) in videos(inputs) {
        let times: Vec<Option<f64>> = same.iter().map(time_s).collect();
        let names = same.iter().map(|input| input.name.as_str());
        let shown = names.zip(shown_for(&times));
        written.extend(write_one_video(folder, shown, pictures, &name)?);
    }
    Ok(written)
}

/// Writes the video of the pictures of images, each given by its name and the seconds that it is shown; `None` if there is no picture.
///
/// # Errors
/// ffmpeg's error.
pub fn write_one_video<'a>(
    folder: &Path,
    shown: impl Iterator<Item = (&'a str, f64)>,
    pictures: &str,
    name: &str,
) -> Result<Option<(PathBuf, usize)>> {
    let picture = |(name, seconds): (&str, f64)| VideoPicture {
        file: format!("{name}{pictures}"),
        seconds,
    };
    let pictures: Vec<VideoPicture> = shown.map(picture).collect();
    if pictures.is_empty() {
        return Ok(None);
    }
    write_video(folder, &pictures, name)?;
    Ok(Some((folder.join(name), pictures.len())))
}

/// The name and the inputs of each video; names are numbered if two recordings share one.
fn videos(inputs: &[Input]) -> Vec<(String, &[Input])> {
    let same = |a: &Input, b: &Input| match (&a.frame, &b.frame) {
        (Some((a, _)), Some((b, _))) => Arc::ptr_eq(a, b),
        (None, None) => true,
        _ => false,
    };
    let mut names = UniqueNames::default();
    let named = inputs.chunk_by(same).map(|inputs| {
        let recording = inputs[0].frame.as_ref().map(|(dataset, _)| dataset.name());
        let name = names.take(&recording.unwrap_or(IMAGES).replace(['/', '\\'], "-"));
        (format!("{name}{VIDEO_ENDING}"), inputs)
    });
    named.collect()
}

fn time_s(input: &Input) -> Option<f64> {
    let (dataset, index) = input.frame.as_ref()?;
    dataset.frames()[*index].time_s
}

#[cfg(test)]
mod tests {
    use super::*;

    fn image(name: &str) -> Input {
        Input {
            path: name.into(),
            name: name.into(),
            frame: None,
        }
    }

    #[test]
    fn images_without_a_recording_become_one_video() {
        let inputs = [image("a"), image("b")];
        let found = videos(&inputs);
        assert_eq!(found.len(), 1);
        assert_eq!(
            (found[0].0.as_str(), found[0].1.len()),
            ("images_video.mp4", 2)
        );
        assert!(videos(&[]).is_empty());
    }
}
