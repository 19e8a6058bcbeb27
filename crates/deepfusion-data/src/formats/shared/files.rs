//! Lists the files and folders in a folder.

pub(crate) use crate::names::name_of;
use crate::{Error, Result};
use deepfusion_fs::natural_order;
use deepfusion_images::is_image;
use std::path::{Path, PathBuf};

/// A path as given, and with its links resolved if that differs. Layouts that are recognised by the folders above
/// check both, because a part of a data set is often a link to another disk.
///
/// # Errors
/// [`Error::File`].
fn both_names(path: &Path) -> Result<Vec<PathBuf>> {
    let real = path.canonicalize().map_err(|e| Error::file(path, e))?;
    let given = std::path::absolute(path).ok();
    let given = given.filter(|given| given.file_name().is_some() && *given != real);
    Ok(given.into_iter().chain([real]).collect())
}

/// The result of `find` for the first of a path's [names](both_names) with a non-empty result.
///
/// # Errors
/// Those of [`both_names`] and of `find`.
pub(crate) fn by_either_name<T>(
    path: &Path,
    find: impl Fn(PathBuf) -> Result<Vec<T>>,
) -> Result<Vec<T>> {
    for name in both_names(path)? {
        let found = find(name)?;
        if !found.is_empty() {
            return Ok(found);
        }
    }
    Ok(Vec::new())
}

/// The PNG and JPEG files of a folder in natural order, without hidden ones. A missing folder is an error.
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

/// The folders in a folder, ordered by name, without hidden ones.
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
