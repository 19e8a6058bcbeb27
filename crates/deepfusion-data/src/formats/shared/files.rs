//! What is in a folder.

use crate::{Error, Result};
use deepfusion_fs::natural_order;
use deepfusion_images::is_image;
use std::path::{Path, PathBuf};

/// A folder's name.
pub(crate) fn name_of(folder: &Path) -> String {
    let name = folder.file_name().unwrap_or(folder.as_os_str());
    name.to_string_lossy().into_owned()
}

/// The names of a path: as it was given, and with its links resolved, where that is another. Layouts that are recognised by the folders above
/// look at both: a part of a data set is often a link to another disk.
///
/// # Errors
/// [`Error::NoSuchPath`], [`Error::File`].
pub(crate) fn both_names(path: &Path) -> Result<Vec<PathBuf>> {
    let real = path.canonicalize().map_err(|e| Error::file(path, e))?;
    let given = std::path::absolute(path).ok();
    let given = given.filter(|given| given.file_name().is_some() && *given != real);
    Ok(given.into_iter().chain([real]).collect())
}

/// The PNG and JPEG files of a folder in their natural order, hidden ones left out; none where there is no such folder.
pub(crate) fn images_in(folder: &Path) -> Result<Vec<PathBuf>> {
    let mut images = Vec::new();
    for entry in std::fs::read_dir(folder).map_err(|e| Error::file(folder, e))? {
        let path = entry.map_err(|e| Error::file(folder, e))?.path();
        let name = path.file_name().and_then(|n| n.to_str()).unwrap_or("");
        if is_image(&path) && !name.starts_with('.') && path.is_file() {
            images.push(path);
        }
    }
    images.sort_by(|a, b| natural_order(a, b));
    Ok(images)
}

/// The folders in a folder, in order of their names, without hidden ones.
pub(crate) fn folders(folder: &Path) -> Result<Vec<PathBuf>> {
    let mut found = Vec::new();
    for entry in std::fs::read_dir(folder).map_err(|e| Error::file(folder, e))? {
        let entry = entry.map_err(|e| Error::file(folder, e))?;
        let hidden = entry.file_name().as_encoded_bytes().starts_with(b".");
        if !hidden && entry.path().is_dir() {
            found.push(entry.path());
        }
    }
    found.sort();
    Ok(found)
}
