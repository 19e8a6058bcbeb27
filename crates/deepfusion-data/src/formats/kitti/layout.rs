//! Finds drives below a path, and the drive around a path.

use super::calibration::Calibration;
use super::config::marked_as_simulated;
use super::moving::MASKS;
use crate::formats::shared::files::folders;
use crate::{Error, Result};
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

/// One drive's folders.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Drive {
    /// Name of the drive's folder, such as `2011_09_26_drive_0005_sync`.
    pub name: String,
    /// Path of the drive's folder, which contains `image_02`, `oxts`, …
    pub folder: PathBuf,
    /// Path of the folder with its calibration files: usually the date folder above it.
    pub date_folder: PathBuf,
}

impl Drive {
    fn at(folder: &Path) -> Self {
        let name = |p: &Path| p.file_name().map(|n| n.to_string_lossy().into_owned());
        let above = folder.parent().unwrap_or(folder);
        // A drive may have its own calibration instead of that in its date folder.
        let own = folder.join(Calibration::CAM_TO_CAM).is_file();
        Self {
            name: name(folder).unwrap_or_else(|| "drive".into()),
            folder: folder.to_owned(),
            date_folder: if own { folder } else { above }.to_owned(),
        }
    }

    /// `<date>/<drive>`, as split files write it.
    #[must_use]
    pub fn split_name(&self) -> String {
        let date = self.folder.parent().and_then(Path::file_name);
        match date {
            Some(date) => format!("{}/{}", date.to_string_lossy(), self.name),
            None => self.name.clone(),
        }
    }

    /// The images of `image_0<camera>`, with their frame numbers. Empty if there is no such camera.
    ///
    /// # Errors
    /// [`Error::File`] if a folder cannot be listed.
    pub fn images(&self, camera: u8) -> Result<Vec<(u64, PathBuf)>> {
        let data = self.folder.join(format!("image_0{camera}")).join("data");
        if !data.is_dir() {
            return Ok(Vec::new());
        }
        numbered_files(&data, &["jpeg", "jpg", "png"])
    }

    /// Whether the drive is simulated: according to its own `dataset.toml`, otherwise its date's; if neither sets it, the drive is
    /// simulated if it has the exact poses and the exact masks of dynamic objects that only `simulate` can write.
    #[must_use]
    pub fn is_simulated(&self) -> bool {
        /// Name of the file with exact poses.
        const POSES: &str = "poses.txt";
        let has = |part: &str| self.folder.join(part).exists();
        marked_as_simulated(&self.folder).unwrap_or_else(|| has(POSES) && has(MASKS))
    }

    /// Path of a frame's velodyne scan, if it exists.
    #[must_use]
    pub fn scan(&self, frame: u64) -> Option<PathBuf> {
        let data = self.folder.join("velodyne_points/data");
        let path = data.join(format!("{frame:010}.bin"));
        path.is_file().then_some(path)
    }
}

/// The drives at `path`: the drive itself, those of a date folder, or those of all dates in a root,
/// ordered by name. Empty if there is no drive.
///
/// # Errors
/// [`Error::File`].
pub fn find_drives(path: &Path) -> Result<Vec<Drive>> {
    // Resolve `.` and links, since the names of the drive and the date are needed.
    let root = path.canonicalize().map_err(|e| Error::file(path, e))?;
    if !root.is_dir() {
        return Ok(Vec::new());
    }
    if is_drive(&root) {
        return Ok(vec![Drive::at(&root)]);
    }
    let mut drives = Vec::new();
    for folder in folders(&root)? {
        if is_drive(&folder) {
            drives.push(Drive::at(&folder));
            continue;
        }
        for inner in folders(&folder)? {
            if is_drive(&inner) {
                drives.push(Drive::at(&inner));
            }
        }
    }
    Ok(drives)
}

/// Whether a folder is a drive: it has the folders of KITTI's cameras, or those of its other sensors.
fn is_drive(folder: &Path) -> bool {
    ["image_02", "image_03"]
        .iter()
        .any(|camera| folder.join(camera).is_dir())
        || (folder.join("oxts/data").is_dir() && folder.join("velodyne_points").is_dir())
}

/// Files named by a number with one of `extensions`, ordered by number. If two have the same number, the later extension
/// wins.
pub(crate) fn numbered_files(folder: &Path, extensions: &[&str]) -> Result<Vec<(u64, PathBuf)>> {
    let mut files: BTreeMap<u64, (usize, PathBuf)> = BTreeMap::new();
    for entry in std::fs::read_dir(folder).map_err(|e| Error::file(folder, e))? {
        let path = entry.map_err(|e| Error::file(folder, e))?.path();
        let text = |part: Option<&std::ffi::OsStr>| Some(part?.to_str()?.to_ascii_lowercase());
        let (Some(stem), Some(extension)) = (text(path.file_stem()), text(path.extension())) else {
            continue;
        };
        // Only digits: `+5` and `._0000000005` (a file of macOS) are not frames.
        let number = stem
            .bytes()
            .all(|b| b.is_ascii_digit())
            .then(|| stem.parse().ok())
            .flatten();
        let rank = extensions.iter().position(|e| *e == extension);
        if let (Some(number), Some(rank)) = (number, rank)
            && files.get(&number).is_none_or(|(other, _)| *other < rank)
        {
            files.insert(number, (rank, path));
        }
    }
    Ok(files.into_iter().map(|(n, (_, path))| (n, path)).collect())
}

/// The drive that contains a folder, if any: giving a folder within a drive is a common mistake.
pub(crate) fn drive_around(folder: &Path) -> Option<PathBuf> {
    let around = folder.ancestors().skip(1).take(2);
    around.map(Path::to_owned).find(|p| is_drive(p))
}
