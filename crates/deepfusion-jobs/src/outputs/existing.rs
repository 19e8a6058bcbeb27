//! Outputs that are there already: they are no images to look at, and nothing is written over them unasked.

use std::path::Path;

use deepfusion_records::Sidecar;

use super::earlier::has_targets;
use super::{DepthOutput, DepthWriter, TargetOutput};
use crate::bulk::{record_lines_path, record_path, sidecar_path};
use crate::{Error, Input, Result};

/// The inputs without the pictures that are outputs themselves: the sidecar of an image beside them lists them, or targets were written beside them. Depth of a
/// picture of depth means nothing. Images that were kept ([`DepthOutput::Image`]) are left out in the folder of the outputs alone.
#[must_use]
pub fn without_outputs(mut inputs: Vec<Input>, folder: &Path) -> Vec<Input> {
    let folder = folder.canonicalize().ok();
    inputs.retain(|input| input.frame.is_some() || !is_output(&input.path, folder.as_deref()));
    inputs
}

/// That no file is there yet that is written of these images and their targets, whoever wrote it: what `writer` writes of each image, its
/// targets in these forms and as JSON, and the file of all targets.
///
/// # Errors
/// [`Error::Exists`] naming the first file that is there.
pub fn require_unwritten(
    writer: &DepthWriter<'_>,
    forms: &[TargetOutput],
    inputs: &[Input],
) -> Result<()> {
    let folder = writer.folder;
    let of = |input: &Input| {
        let name = &input.name;
        let mut paths = writer.paths(input);
        paths.extend(forms.iter().map(|form| form.path(folder, name)));
        paths.push(record_path(folder, name));
        paths
    };
    let mut paths = inputs
        .iter()
        .flat_map(of)
        .chain([record_lines_path(folder)]);
    match paths.find(|path| path.exists()) {
        Some(path) => Err(Error::Exists { path }),
        None => Ok(()),
    }
}

/// Whether a picture is an output; `folder` is that of the outputs to come, without links.
fn is_output(picture: &Path, folder: Option<&Path>) -> bool {
    let parent = match picture.parent() {
        // A bare name lies in the current folder.
        Some(parent) if parent == Path::new("") => Path::new("."),
        Some(parent) => parent,
        None => return false,
    };
    let Some(name) = picture.file_name().and_then(|name| name.to_str()) else {
        return false;
    };
    let of_an_image = |output: &DepthOutput| {
        let image = name.strip_suffix(output.ending());
        let listed = |sidecar: Sidecar| sidecar.files.iter().any(|file| file == name);
        image.is_some_and(|image| {
            let text = std::fs::read(sidecar_path(parent, image)).unwrap_or_default();
            serde_json::from_slice(&text).is_ok_and(listed)
        })
    };
    let of_targets = |output: &TargetOutput| {
        let image = name.strip_suffix(output.ending());
        image.is_some_and(|image| has_targets(parent, image))
    };
    if of_an_image(&DepthOutput::Image) {
        return folder.is_some() && parent.canonicalize().ok().as_deref() == folder;
    }
    DepthOutput::ALL.iter().any(of_an_image) || TargetOutput::PICTURES.iter().any(of_targets)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn pictures_of_targets_are_no_inputs() {
        let folder = tempfile::tempdir().unwrap();
        let at = |file: &str| folder.path().join(file);
        let input = |file: &str| Input {
            path: at(file),
            name: file.to_owned(),
            frame: None,
        };
        // Of the second image nothing was written: its name ends like a picture's by chance. Beside the third somebody keeps targets of his own.
        let images = ["a.png", "b_overlay.png", "c_segments.png", "a_overlay.png"].map(input);
        for file in ["a.png", "b_overlay.png", "c_segments.png", "a_overlay.png"] {
            std::fs::write(at(file), []).unwrap();
        }
        std::fs::write(at("a_targets.json"), r#"{"frame": "a"}"#).unwrap();
        std::fs::write(at("c_targets.json"), r#"[{"class": "car"}]"#).unwrap();
        let left = without_outputs(images.to_vec(), folder.path());
        assert_eq!(left, images[..3]);
        // Whatever folder the next outputs go to.
        assert_eq!(without_outputs(images.to_vec(), &at("none")), images[..3]);
    }
}
