//! The pictures of a run as videos, one of each recording.

use std::path::Path;

use anyhow::Result;
use deepfusion_data::{Shown, can_write_video, shown_for, write_video};

use super::inputs::Input;
use super::outputs::file_name;
use crate::cli::{PredictArgs, Save, Shard};
use crate::error::CliError;
use crate::progress::say;

/// What the video of images that are of no recording is called.
const IMAGES: &str = "images";

/// Whether videos can be written in the end, to know before the work begins.
pub fn check(args: &PredictArgs) -> Result<()> {
    if !args.video() {
        return Ok(());
    }
    if args.shard != Shard::WHOLE {
        return Err(CliError::VideoShard.into());
    }
    Ok(can_write_video(&args.prediction.out)?)
}

/// One video of each recording among the inputs, and one of the images that are of none, in the folder of their
/// pictures. Others of the same names are replaced: they are made of the pictures that are there.
pub fn write(folder: &Path, inputs: &[Input]) -> Result<()> {
    for same in inputs.chunk_by(|a, b| recording(a) == recording(b)) {
        let times: Vec<Option<f64>> = same.iter().map(time_s).collect();
        let shown = same.iter().zip(shown_for(&times));
        let shown = shown.map(|(input, seconds)| (input.name.as_str(), seconds));
        let name = recording(&same[0]).unwrap_or(IMAGES);
        write_one(folder, shown, name)?;
    }
    Ok(())
}

/// The video of pictures, by the names of their images, each with the seconds that it is shown.
pub fn write_one<'a>(
    folder: &Path,
    shown: impl Iterator<Item = (&'a str, f64)>,
    recording: &str,
) -> Result<()> {
    let picture = |(name, seconds): (&str, f64)| Shown {
        file: file_name(name, Save::SideBySide),
        seconds,
    };
    let pictures: Vec<Shown> = shown.map(picture).collect();
    let name = file_name(&recording.replace(['/', '\\'], "-"), Save::Video);
    write_video(folder, &pictures, &name)?;
    say(&format!(
        "{}: {} frames",
        folder.join(name).display(),
        pictures.len()
    ));
    Ok(())
}

/// The name of the recording that an input is a frame of.
fn recording(input: &Input) -> Option<&str> {
    input.frame.as_ref().map(|(dataset, _)| dataset.name())
}

fn time_s(input: &Input) -> Option<f64> {
    let (dataset, index) = input.frame.as_ref()?;
    dataset.frames()[*index].time_s
}
