use std::path::Path;

use deepfusion_records::Sidecar;

use super::{DepthOutput, TargetOutput};
use crate::bulk::{record_path, sidecar_path};

/// Whether a picture lies in the folder of the outputs, given without links, and is one of them: the sidecar of an image lists it, or
/// targets were written beside it. Depth of a picture of depth means nothing.
#[must_use]
pub fn is_output(folder: &Path, picture: &Path) -> bool {
    let name = picture.file_name().and_then(|name| name.to_str());
    let parent = picture.parent().map(|parent| {
        // A bare name lies in the current folder.
        if parent == Path::new("") {
            Path::new(".")
        } else {
            parent
        }
    });
    let parent = parent.and_then(|parent| parent.canonicalize().ok());
    let Some(name) = name.filter(|_| parent.as_deref() == Some(folder)) else {
        return false;
    };
    let of_an_image = |output: &DepthOutput| {
        let image = name.strip_suffix(output.ending());
        let listed = |sidecar: Sidecar| sidecar.files.iter().any(|file| file == name);
        image.is_some_and(|image| {
            let text = std::fs::read(sidecar_path(folder, image)).unwrap_or_default();
            serde_json::from_slice(&text).is_ok_and(listed)
        })
    };
    let of_targets = |output: &TargetOutput| {
        let image = name.strip_suffix(output.ending());
        image.is_some_and(|image| record_path(folder, image).exists())
    };
    DepthOutput::ALL.iter().any(of_an_image) || TargetOutput::PICTURES.iter().any(of_targets)
}
