//! `metadata.yaml`: the list of files in a recording's folder. The files themselves describe their content.

use crate::problem::{KEY, StorageProblem};
use deepfusion_rosbag::{Error, Result};
use serde::Deserialize;
use std::path::{Path, PathBuf};

/// The file that makes a folder a bag.
pub(crate) const NAME: &str = "metadata.yaml";

#[derive(Deserialize)]
struct Root {
    rosbag2_bagfile_information: Information,
}

#[derive(Deserialize)]
struct Information {
    relative_file_paths: Vec<String>,
}

/// Whether a folder is a bag: other programs have files of this name too.
pub(crate) fn is_bag(folder: &Path) -> bool {
    let text = std::fs::read_to_string(folder.join(NAME));
    text.is_ok_and(|text| text.contains(KEY))
}

/// The recording's files, in order of time.
///
/// # Errors
/// [`Error::File`]; [`Error::Storage`] if it is not such a file.
pub(crate) fn files(folder: &Path) -> Result<Vec<PathBuf>> {
    let path = folder.join(NAME);
    let text = std::fs::read_to_string(&path).map_err(|e| Error::file(&path, e))?;
    let root: Root = serde_saphyr::from_str(&text)
        .map_err(|e| StorageProblem::Metadata(Box::new(e)).of(&path))?;
    let files = root.rosbag2_bagfile_information.relative_file_paths;
    Ok(files.iter().map(|file| place(folder, file)).collect())
}

/// Old recorders put the folder's own name before the file's.
fn place(folder: &Path, file: &str) -> PathBuf {
    let path = folder.join(file);
    match (path.is_file(), Path::new(file).file_name()) {
        (false, Some(name)) => folder.join(name),
        _ => path,
    }
}
