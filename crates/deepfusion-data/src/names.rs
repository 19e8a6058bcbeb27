//! Names of files and folders.

use std::path::Path;

/// The last part of a path, or all of it if it does not end in a name (`..`).
pub(crate) fn name_of(path: &Path) -> String {
    let name = path.file_name().unwrap_or(path.as_os_str());
    name.to_string_lossy().into_owned()
}
