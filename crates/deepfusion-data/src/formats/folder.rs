//! Opens a folder of images with tables and a calibration beside them.

use super::shared::files::{images_in, name_of};
use super::shared::plain::PlainParts;
use crate::camera::{Pictures, find_camera};
use crate::dataset_toml::FolderConfig;
use crate::logs::frame_times::timed_images;
use crate::logs::speed_log::SpeedLog;
use crate::truth::depth_images::DepthImages;
use crate::truth::measured::MeasuredDepth;
use crate::{
    Camera, ColumnsProblem, DataWarning, Dataset, DatasetKind, Error, NoFramesReason, OpenOptions,
    Result, TimesWarning, image_size,
};
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

/// Folders in which the images are looked for, before the recording's folder itself.
const FOLDERS: [&str; 2] = ["images", "frames"];

/// Whether a folder is a folder of images.
pub(crate) fn has_images(folder: &Path) -> Result<bool> {
    let config = FolderConfig::read(folder)?;
    Ok(config.images.is_some() || !images_in(&images_folder(folder, &config)?)?.is_empty())
}

/// Opens a folder of images.
pub(crate) fn open(folder: &Path, options: &OpenOptions) -> Result<Dataset> {
    let config = FolderConfig::read(folder)?;
    let mut warnings = Vec::new();
    let place = images_folder(folder, &config)?;
    let images = images_in(&place)?;
    let Some(first) = images.first() else {
        return Err(Error::NoFrames {
            path: place,
            reason: NoFramesReason::NoPicture,
        });
    };
    let size = image_size(first)?;
    let calibration = find_camera(
        folder,
        &config,
        options,
        size,
        DatasetKind::Folder,
        Pictures::Images(&images),
        &mut warnings,
    )?;
    let images = timed_images(folder, images, &config, &mut warnings)?;
    let stems = images
        .iter()
        .filter_map(|i| Some((i.path.file_stem()?, i.number)));
    let depth = depth_images(folder, &config, stems.collect())?;
    let speeds = SpeedLog::read(folder, &config)?;
    // The time zone of the images' dates does not matter without a log, or if the first image's time is given.
    if speeds.is_none() || config.start_s.is_some() {
        warnings.retain(|w| !matches!(w, DataWarning::Times(TimesWarning::NoZone { .. })));
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
        // The mount converts the vehicle's motion into the camera's, so it does not matter without motion.
        mount_assumed: config.mount.is_none() && speeds.is_some(),
        speeds,
        cam_from_vehicle: config.cam_from_vehicle(),
        camera: Camera::Left,
        truth: depth.map(MeasuredDepth::Images),
        world_from_cam: BTreeMap::new(),
        streams: Vec::new(),
        warnings,
        untimed_poses: false,
    }
    .into_dataset()
    .map(|dataset| dataset.with_simulated(config.simulated))
}

/// The folder of the images: the one named in `dataset.toml`, otherwise one with a usual name, otherwise the recording's own.
///
/// # Errors
/// [`Error::Config`] if a named folder does not exist.
pub(crate) fn images_folder(folder: &Path, config: &FolderConfig) -> Result<PathBuf> {
    let found = config.find(folder, "images", config.images.as_ref(), &FOLDERS)?;
    Ok(found
        .filter(|p| p.is_dir())
        .unwrap_or_else(|| folder.to_owned()))
}

/// The depth images with the names of frames.
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
        problem: ColumnsProblem::NoDepthUnit,
    })?;
    Ok(Some(DepthImages {
        files,
        unit_m,
        invalid: config.depth_invalid,
    }))
}
