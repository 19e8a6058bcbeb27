//! Telling layouts apart, and saying what was looked for where none fits.

use crate::config::FolderConfig;
use crate::kitti::{self, Drive, find_drives, layout};
use crate::{Dataset, DatasetKind, Error, OpenOptions, Result, bag, comma, folder, rgbd, video};
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

/// What lies at a path.
#[derive(Debug)]
pub(crate) enum Layout {
    Kitti(Vec<Drive>),
    Comma(PathBuf),
    RgbD(Vec<PathBuf>),
    Bags(Vec<PathBuf>),
    Folder(PathBuf),
    Video(PathBuf),
}

impl Layout {
    /// The first layout that fits.
    ///
    /// # Errors
    /// [`Error::NoSuchPath`], [`Error::UnknownLayout`].
    pub(crate) fn of(path: &Path) -> Result<Self> {
        let drives = find_drives(path)?;
        if !drives.is_empty() {
            return Ok(Self::Kitti(drives));
        }
        // `.` and links have names too once they are resolved.
        let real = path.canonicalize().map_err(|e| Error::file(path, e))?;
        let unknown = |found| Error::UnknownLayout {
            path: path.to_owned(),
            found,
        };
        let given = named(path, &real);
        // By either name: a link may have no ending, or lead to a store whose files have none.
        if bag::is_bag(&given) || bag::is_bag(&real) {
            return Ok(Self::Bags(vec![given]));
        }
        if !real.is_dir() {
            return match video::is_video(&real) {
                true => Ok(Self::Video(real)),
                false => Err(unknown(describe_file(&real))),
            };
        }
        if let Some(drive) = layout::drive_around(&real) {
            let drive = drive.display();
            return Err(unknown(format!("it lies within the drive {drive}")));
        }
        if comma::is_segment(&real) {
            return Ok(Self::Comma(real));
        }
        let bags = bag::bags_in(&real)?;
        if !bags.is_empty() {
            return Ok(Self::Bags(bags));
        }
        let rgbd = rgbd::find(&real)?;
        if !rgbd.is_empty() {
            return Ok(Self::RgbD(rgbd));
        }
        let (images, video) = (folder::has_images(&real)?, video::in_folder(&real)?);
        match (images, video) {
            (true, Some(video)) if !video.named => Err(Error::Config {
                path: real.join(FolderConfig::NAME),
                problem: format!(
                    "there are images and a video ({}): name one, images = \"…\" or video = \"…\"",
                    video.file.display()
                ),
            }),
            (_, Some(_)) => Ok(Self::Video(real)),
            (true, None) => Ok(Self::Folder(real)),
            (false, None) => Err(unknown(describe_folder(&real)?)),
        }
    }

    /// Its name.
    pub(crate) fn kind(&self) -> DatasetKind {
        match self {
            Self::Kitti(_) => DatasetKind::KittiRaw,
            Self::Comma(_) => DatasetKind::Comma2k19,
            Self::RgbD(_) => DatasetKind::RgbD,
            Self::Bags(_) => DatasetKind::Bag,
            Self::Folder(_) => DatasetKind::Folder,
            Self::Video(_) => DatasetKind::Video,
        }
    }

    /// Opens what was found.
    pub(crate) fn open(&self, path: &Path, options: &OpenOptions) -> Result<Vec<Dataset>> {
        let one = |dataset: Result<Dataset>| Ok(vec![dataset?.select(path, options)?]);
        match self {
            Self::Kitti(drives) => kitti::open(path, drives, options),
            Self::Comma(folder) => one(comma::open(folder, options)),
            Self::RgbD(folders) => rgbd::open(path, folders, options),
            Self::Bags(bags) => bag::open(path, bags, options),
            Self::Folder(folder) => one(folder::open(folder, options)),
            Self::Video(place) => one(video::open(place, options)),
        }
    }
}

/// The path as it was given, links and all, since a bag's file lies beside the link; what it resolves to where the given
/// path ends without a name (`..`).
fn named(path: &Path, real: &Path) -> PathBuf {
    let given = std::path::absolute(path).ok();
    given
        .filter(|given| given.file_name().is_some())
        .unwrap_or_else(|| real.to_owned())
}

/// Why a ROS 2 bag is no recording here.
pub(crate) const WITHOUT_ROS2: &str = match cfg!(feature = "ros2") {
    true => "",
    false => ", and this program was built without the feature `ros2`",
};

fn describe_file(path: &Path) -> String {
    let extension = path.extension().and_then(|e| e.to_str()).unwrap_or("");
    match extension.to_ascii_lowercase().as_str() {
        "mcap" | "db3" => format!("it is a ROS 2 bag{WITHOUT_ROS2}"),
        "png" | "jpg" | "jpeg" => "it is a single image".into(),
        "mp4" | "mkv" | "avi" | "mov" | "hevc" => "it is a video".into(),
        "zip" | "tar" | "gz" | "tgz" => "it is an archive that is still packed".into(),
        _ => "it is a file".into(),
    }
}

/// What a folder without drives looks like.
fn describe_folder(folder: &Path) -> Result<String> {
    let mut kinds: BTreeMap<&str, usize> = BTreeMap::new();
    let (mut files, mut first) = (0_usize, None);
    let inner = layout::folders(folder)?;
    for place in std::iter::once(folder.to_owned()).chain(inner.iter().cloned()) {
        for entry in std::fs::read_dir(&place).map_err(|e| Error::file(&place, e))? {
            let path = entry.map_err(|e| Error::file(&place, e))?.path();
            if path.is_dir() {
                continue;
            }
            files += 1;
            first.get_or_insert(path.clone());
            let extension = path.extension().and_then(|e| e.to_str()).unwrap_or("");
            let kind = match extension.to_ascii_lowercase().as_str() {
                "png" | "jpg" | "jpeg" => "images",
                "mcap" | "db3" => "ROS 2 bags",
                "bag" => "ROS bags",
                "mp4" | "mkv" | "avi" | "mov" | "hevc" => "videos",
                "zip" | "tar" | "gz" | "tgz" => "packed archives",
                "bin" => ".bin files",
                _ => continue,
            };
            *kinds.entry(kind).or_default() += 1;
        }
    }
    if files == 0 && inner.is_empty() {
        return Ok("it is empty".into());
    }
    if !kinds.is_empty() {
        let list: Vec<String> = kinds.iter().map(|(k, n)| format!("{n} {k}")).collect();
        let without = match kinds.contains_key("ROS 2 bags") {
            true => WITHOUT_ROS2,
            false => "",
        };
        return Ok(format!(
            "it holds {} and nothing that says how to read them{without}",
            list.join(", ")
        ));
    }
    let shown = first.or_else(|| inner.first().cloned()).unwrap_or_default();
    let shown = shown.strip_prefix(folder).unwrap_or(&shown).to_owned();
    Ok(format!(
        "it holds {files} files and {} folders (such as {})",
        inner.len(),
        shown.display()
    ))
}
