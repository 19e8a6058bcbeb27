//! Whether there is room for what is written of images and their targets.

use super::{DepthWriter, TargetOutput};
use crate::bulk::{record_lines_path, record_path};
use crate::{Error, Input, Result};

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
