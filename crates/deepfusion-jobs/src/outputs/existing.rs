//! Existing outputs: they are not inputs, and are not overwritten unless requested.

use std::path::Path;

use deepfusion_records::Sidecar;

use super::earlier::has_targets;
use super::{DepthOutput, DepthWriter, TargetOutput};
use crate::bulk::{record_lines_path, record_path, sidecar_path};
use crate::{Error, Input, Result};

/// The inputs without pictures that are outputs themselves: the sidecar of an image beside them lists them, or targets were written beside
/// them. Depth of a picture of depth is meaningless. Saved images ([`DepthOutput::Image`]) are only left out if they are in the output
/// folder.
#[must_use]
pub fn without_outputs(mut inputs: Vec<Input>, folder: &Path) -> Vec<Input> {
    let folder = folder.canonicalize().ok();
    inputs.retain(|input| input.frame.is_some() || !is_output(&input.path, folder.as_deref()));
    inputs
}

/// Checks that no file exists yet that would be written for these images and their targets: the outputs of `writer`, the targets in these
/// forms and as JSON, and the file with all targets.
///
/// # Errors
/// [`Error::Exists`] with the first existing file.
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

/// Whether a picture is an output; `folder` is the folder of the new outputs, with links resolved.
fn is_output(picture: &Path, folder: Option<&Path>) -> bool {
    let parent = match picture.parent() {
        // A name without a folder is in the current folder.
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
    fn pictures_of_targets_are_not_inputs() {
        let folder = tempfile::tempdir().unwrap();
        let at = |file: &str| folder.path().join(file);
        let input = |file: &str| Input {
            path: at(file),
            name: file.to_owned(),
            frame: None,
        };
        // Nothing was written for the second image: its name ends like a picture's by chance. Beside the third, the user keeps their own
        // targets.
        let images = ["a.png", "b_overlay.png", "c_segments.png", "a_overlay.png"].map(input);
        for file in ["a.png", "b_overlay.png", "c_segments.png", "a_overlay.png"] {
            std::fs::write(at(file), []).unwrap();
        }
        std::fs::write(at("a_targets.json"), r#"{"frame": "a"}"#).unwrap();
        std::fs::write(at("c_targets.json"), r#"[{"class": "car"}]"#).unwrap();
        let left = without_outputs(images.to_vec(), folder.path());
        assert_eq!(left, images[..3]);
        // Whatever folder the new outputs go to.
        assert_eq!(without_outputs(images.to_vec(), &at("none")), images[..3]);
    }
}
