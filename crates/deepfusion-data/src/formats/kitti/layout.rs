//! Finding drives below a path, and saying what is there where there are none.

use super::calibration::Calibration;
use super::config::says_simulated;
use super::moving::MASKS;
use crate::formats::shared::files::folders;
use crate::{Error, Result};
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

/// One drive's folders.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Drive {
    /// The drive folder's name, such as `2011_09_26_drive_0005_sync`.
    pub name: String,
    /// The drive folder, with `image_02`, `oxts`, … in it.
    pub folder: PathBuf,
    /// Where its calibration files are: the date folder above it.
    pub date_folder: PathBuf,
}

impl Drive {
    fn at(folder: &Path) -> Self {
        let name = |p: &Path| p.file_name().map(|n| n.to_string_lossy().into_owned());
        let above = folder.parent().unwrap_or(folder);
        // A drive that carries its own calibration is as good as one under its date.
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

    /// The images of `image_0<camera>`, by frame number. Empty where the camera is not there.
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

    /// Whether nobody drove it: `dataset.toml`, its own or else its date's, says so; where neither says anything, it has what `simulate` writes
    /// beside its images and nobody can record, exact poses and exact masks of dynamic objects.
    #[must_use]
    pub fn is_simulated(&self) -> bool {
        /// Exact poses.
        const POSES: &str = "poses.txt";
        let has = |part: &str| self.folder.join(part).exists();
        says_simulated(&self.folder).unwrap_or_else(|| has(POSES) && has(MASKS))
    }

    /// The velodyne scan of a frame, where there is one.
    #[must_use]
    pub fn scan(&self, frame: u64) -> Option<PathBuf> {
        let data = self.folder.join("velodyne_points/data");
        let path = data.join(format!("{frame:010}.bin"));
        path.is_file().then_some(path)
    }
}

/// The drives at `path`: the drive itself, those of a date folder, or those of all dates in a root;
/// in order of their names. None where there is no drive.
///
/// # Errors
/// [`Error::File`].
pub fn find_drives(path: &Path) -> Result<Vec<Drive>> {
    // `.` and links have names too once they are resolved: the drive's and the date's are needed.
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

/// A drive is known by its cameras' folders, or by its other sensors' under KITTI's naming.
fn is_drive(folder: &Path) -> bool {
    ["image_02", "image_03"]
        .iter()
        .any(|camera| folder.join(camera).is_dir())
        || (folder.join("oxts/data").is_dir() && folder.join("velodyne_points").is_dir())
}

/// Files named by a number with one of `extensions`, by number. Where two share a number, the last of
/// the extensions wins.
pub(crate) fn numbered_files(folder: &Path, extensions: &[&str]) -> Result<Vec<(u64, PathBuf)>> {
    let mut files: BTreeMap<u64, (usize, PathBuf)> = BTreeMap::new();
    for entry in std::fs::read_dir(folder).map_err(|e| Error::file(folder, e))? {
        let path = entry.map_err(|e| Error::file(folder, e))?.path();
        let text = |part: Option<&std::ffi::OsStr>| Some(part?.to_str()?.to_ascii_lowercase());
        let (Some(stem), Some(extension)) = (text(path.file_stem()), text(path.extension())) else {
            continue;
        };
        // Digits alone: `+5` and `._0000000005` (macOS leaves such files) are no frames.
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

/// The drive that a folder lies in, if it does: giving a folder within a drive is the likeliest slip.
pub(crate) fn drive_around(folder: &Path) -> Option<PathBuf> {
    let around = folder.ancestors().skip(1).take(2);
    around.map(Path::to_owned).find(|p| is_drive(p))
}
