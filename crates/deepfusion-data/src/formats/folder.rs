//! A folder of images with tables and a calibration beside them.

use crate::calibration::find_camera;
use crate::config::FolderConfig;
use crate::depth_images::DepthImages;
use crate::frame_times::timed_images;
use crate::plain::PlainParts;
use crate::speed_log::SpeedLog;
use crate::{Dataset, DatasetKind, Error, OpenOptions, Result, image_size};
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

/// Folders in which the images are looked for; then the recording's folder itself.
const FOLDERS: [&str; 2] = ["images", "frames"];
pub(crate) const CAMERA_REMEDY: &str = "put calibration.yaml (OpenCV, ROS or Kalibr) or intrinsics.txt (fx, fy, cx, cy) \
     there, or set intrinsics = [fx, fy, cx, cy] in dataset.toml";
pub(crate) const SPEED_REMEDY: &str = "training needs speed.csv (time_s,speed_mps) beside the images; evaluation and prediction do not";

/// Whether a folder is one of images.
pub(crate) fn has_images(folder: &Path) -> Result<bool> {
    let config = FolderConfig::read(folder)?;
    Ok(config.images.is_some() || !images_in(&images_folder(folder, &config)?)?.is_empty())
}

/// Opens a folder of images.
pub(crate) fn open(folder: &Path, options: &OpenOptions) -> Result<Dataset> {
    let config = FolderConfig::read(folder)?;
    let mut remarks = Vec::new();
    let place = images_folder(folder, &config)?;
    let images = images_in(&place)?;
    let Some(first) = images.first() else {
        return Err(Error::NoFrames {
            path: place,
            why: "no image (.png, .jpg, .jpeg)".into(),
            remedy: "name the folder of the images in dataset.toml: images = \"…\"".into(),
        });
    };
    let size = image_size(first)?;
    let calibration = find_camera(folder, &config, options, size, CAMERA_REMEDY)?;
    let images = timed_images(folder, images, &config, &mut remarks)?;
    let stems = images
        .iter()
        .filter_map(|i| Some((i.path.file_stem()?, i.number)));
    let depth = depth_images(folder, &config, stems.collect())?;
    if config.mount.is_none() {
        remarks.push(NO_MOUNT.into());
    }
    PlainParts {
        kind: DatasetKind::Folder,
        folder: folder.to_owned(),
        name: name_of(folder),
        images,
        video: None,
        calibration,
        camera_ahead_s: config.camera_ahead_s(options),
        image_size: size,
        speeds: SpeedLog::read(folder, &config)?,
        cam_from_vehicle: config.cam_from_vehicle(),
        depth,
        world_from_cam: BTreeMap::new(),
        streams: Vec::new(),
        remarks,
        speed_remedy: SPEED_REMEDY,
    }
    .into_dataset()
}

/// What is said where nothing tells where the camera is.
pub(crate) const NO_MOUNT: &str = "the camera's place on the vehicle is not given ([mount] in dataset.toml): it is taken to look straight \
     ahead and to move as the vehicle does";

/// A folder's name.
pub(crate) fn name_of(folder: &Path) -> String {
    let name = folder.file_name().unwrap_or(folder.as_os_str());
    name.to_string_lossy().into_owned()
}

fn images_folder(folder: &Path, config: &FolderConfig) -> Result<PathBuf> {
    let found = config.find(folder, "images", config.images.as_ref(), &FOLDERS)?;
    Ok(found
        .filter(|p| p.is_dir())
        .unwrap_or_else(|| folder.to_owned()))
}

/// The PNG and JPEG files of a folder, hidden ones left out; none where there is no such folder.
pub(crate) fn images_in(folder: &Path) -> Result<Vec<PathBuf>> {
    let mut images = Vec::new();
    for entry in std::fs::read_dir(folder).map_err(|e| Error::file(folder, e))? {
        let path = entry.map_err(|e| Error::file(folder, e))?.path();
        let extension = path.extension().and_then(|e| e.to_str()).unwrap_or("");
        let known = ["png", "jpg", "jpeg"].contains(&extension.to_ascii_lowercase().as_str());
        let name = path.file_name().and_then(|n| n.to_str()).unwrap_or("");
        if known && !name.starts_with('.') && path.is_file() {
            images.push(path);
        }
    }
    images.sort();
    Ok(images)
}

/// The depth images whose names are those of frames.
fn depth_images(
    folder: &Path,
    config: &FolderConfig,
    numbers: BTreeMap<&std::ffi::OsStr, u64>,
) -> Result<Option<DepthImages>> {
    let Some(place) = config.find(folder, "depth", config.depth.as_ref(), &["depth"])? else {
        return Ok(None);
    };
    if !place.is_dir() {
        return Ok(None);
    }
    let images = images_in(&place)?.into_iter();
    let files: BTreeMap<u64, PathBuf> = images
        .filter_map(|path| Some((*numbers.get(path.file_stem()?)?, path)))
        .collect();
    if files.is_empty() {
        return Ok(None);
    }
    let unit_m = config.depth_unit_m.ok_or_else(|| Error::Columns {
        path: place.clone(),
        problem: "nothing says the unit of the depth images".into(),
        remedy: "set depth_unit_m in dataset.toml: 0.001 for millimetres, 0.00390625 for KITTI's 1/256 m"
            .into(),
    })?;
    Ok(Some(DepthImages {
        files,
        unit_m,
        invalid: config.depth_invalid,
    }))
}
