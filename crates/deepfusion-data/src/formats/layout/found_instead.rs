//! Finds out what is at a path without a recording of a known layout.

use crate::formats::shared::files::folders;
use crate::{Error, FileKind, FoundInstead, Result};
use deepfusion_images::is_image;
use deepfusion_video::is_video;
use std::collections::BTreeMap;
use std::path::Path;

/// Describes a file that is not a recording.
pub(super) fn file(path: &Path) -> FoundInstead {
    match kind_of(path) {
        Some(FileKind::Ros2Bags) => FoundInstead::Ros2Bag,
        Some(FileKind::Images) => FoundInstead::Image,
        Some(FileKind::Archives) => FoundInstead::Archive,
        _ => FoundInstead::File,
    }
}

/// Describes a folder without a recording, from the names of its files and those in its folders, except hidden ones.
///
/// # Errors
/// [`Error::File`].
pub(super) fn folder(folder: &Path) -> Result<FoundInstead> {
    let mut kinds = BTreeMap::new();
    let (mut files, mut first) = (0_usize, None);
    let inner = folders(folder)?;
    for place in std::iter::once(folder.to_owned()).chain(inner.iter().cloned()) {
        for entry in std::fs::read_dir(&place).map_err(|e| Error::file(&place, e))? {
            let entry = entry.map_err(|e| Error::file(&place, e))?;
            let hidden = entry.file_name().as_encoded_bytes().starts_with(b".");
            let path = entry.path();
            if hidden || path.is_dir() {
                continue;
            }
            files += 1;
            if let Some(kind) = kind_of(&path) {
                *kinds.entry(kind).or_default() += 1;
            }
            first.get_or_insert(path);
        }
    }
    if files == 0 && inner.is_empty() {
        return Ok(FoundInstead::Empty);
    }
    if !kinds.is_empty() {
        return Ok(FoundInstead::Files { kinds });
    }
    let such_as = first.or_else(|| inner.first().cloned()).unwrap_or_default();
    Ok(FoundInstead::Others {
        files,
        folders: inner.len(),
        such_as: such_as.strip_prefix(folder).unwrap_or(&such_as).to_owned(),
    })
}

/// The kind of a file, by its extension.
fn kind_of(path: &Path) -> Option<FileKind> {
    if is_image(path) {
        return Some(FileKind::Images);
    }
    if is_video(path) {
        return Some(FileKind::Videos);
    }
    let extension = path.extension()?.to_str()?;
    Some(match extension.to_ascii_lowercase().as_str() {
        "mcap" | "db3" => FileKind::Ros2Bags,
        "bag" => FileKind::RosBags,
        "zip" | "tar" | "gz" | "tgz" => FileKind::Archives,
        "bin" => FileKind::Bin,
        _ => return None,
    })
}
