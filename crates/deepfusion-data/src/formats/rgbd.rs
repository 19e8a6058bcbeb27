//! Reads folders with a colour, depth and pose file for each frame, as in the 7-Scenes data set.

use super::shared::files::{folders, images_in, name_of};
use super::shared::plain::{PlainParts, open_each};
use super::shared::poses::motion_of_rows;
use crate::camera::{Pictures, find_camera};
use crate::dataset_toml::FolderConfig;
use crate::logs::frame_times::TimedImage;
use crate::truth::depth_images::DepthImages;
use crate::truth::measured::MeasuredDepth;
use crate::{
    Camera, Dataset, DatasetKind, Error, NoFramesReason, OpenOptions, PoseFileProblem, Result,
    image_size,
};
use deepfusion_geometry::Se3;
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

/// Unit of the depth images (millimetres), and the value of pixels without depth.
const UNIT_M: f64 = 0.001;
const INVALID: u16 = 65_535;

/// The sequences at a path: the folder itself, or the folders in it.
pub(crate) fn find(folder: &Path) -> Result<Vec<PathBuf>> {
    if !colour_images(folder)?.is_empty() {
        return Ok(vec![folder.to_owned()]);
    }
    let mut found = Vec::new();
    for inner in folders(folder)? {
        if !colour_images(&inner)?.is_empty() {
            found.push(inner);
        }
    }
    Ok(found)
}

/// Opens each sequence found at `path` as a data set, except those without a selected frame.
pub(crate) fn open(
    path: &Path,
    sequences: &[PathBuf],
    options: &OpenOptions,
) -> Result<Vec<Dataset>> {
    open_each(path, sequences, options, |folder| {
        open_sequence(folder, options)
    })
}

fn open_sequence(folder: &Path, options: &OpenOptions) -> Result<Dataset> {
    let config = FolderConfig::read(folder)?;
    let colour = colour_images(folder)?;
    let Some((_, first)) = colour.first_key_value() else {
        return Err(Error::NoFrames {
            path: folder.to_owned(),
            reason: NoFramesReason::NoColour,
        });
    };
    let size = image_size(first)?;
    let calibration = find_camera(
        folder,
        &config,
        options,
        size,
        DatasetKind::RgbD,
        Pictures::Images(&[]),
        &mut Vec::new(),
    )?;
    let (mut depth, mut world_from_cam) = (BTreeMap::new(), BTreeMap::new());
    for &number in colour.keys() {
        let part = |ending: &str| folder.join(format!("frame-{number:06}.{ending}"));
        let image = part("depth.png");
        if image.is_file() {
            depth.insert(number, image);
        }
        let pose = part("pose.txt");
        if pose.is_file()
            && let Some(pose) = read_pose(&pose)?
        {
            world_from_cam.insert(number, pose);
        }
    }
    let interval = config.fps.map(|fps| 1e9 / fps);
    let image = |(number, path): (u64, PathBuf)| TimedImage {
        number,
        path,
        ns: interval.map(|ns| (number as f64 * ns).round() as i64),
    };
    PlainParts {
        kind: DatasetKind::RgbD,
        folder: folder.to_owned(),
        name: name_of(folder),
        images: colour.into_iter().map(image).collect(),
        video: None,
        calibration,
        camera_ahead_s: config.camera_ahead_s(options),
        image_size: size,
        speeds: None,
        mount_assumed: false,
        cam_from_vehicle: config.cam_from_vehicle(),
        camera: Camera::Left,
        truth: Some(MeasuredDepth::Images(DepthImages {
            files: depth,
            unit_m: config.depth_unit_m.unwrap_or(UNIT_M),
            invalid: Some(config.depth_invalid.unwrap_or(INVALID)),
        })),
        world_from_cam,
        streams: Vec::new(),
        warnings: Vec::new(),
        untimed_poses: false,
    }
    .into_dataset()
    .map(|dataset| dataset.with_simulated(config.simulated))
}

/// `frame-<number>.color.png` and `.jpg`, by number.
fn colour_images(folder: &Path) -> Result<BTreeMap<u64, PathBuf>> {
    let number = |path: &Path| -> Option<u64> {
        let name = path.file_name()?.to_str()?.strip_prefix("frame-")?;
        let (number, ending) = name.split_once('.')?;
        let digits = !number.is_empty() && number.bytes().all(|b| b.is_ascii_digit());
        (digits && ending.starts_with("color.")).then(|| number.parse().ok())?
    };
    let images = images_in(folder)?.into_iter();
    Ok(images
        .filter_map(|path| Some((number(&path)?, path)))
        .collect())
}

/// Reads a pose file: `world_from_cam` as four rows of four numbers, in metres. `None` for numbers that are not finite,
/// which 7-Scenes writes if tracking was lost.
fn read_pose(path: &Path) -> Result<Option<Se3>> {
    let text = std::fs::read_to_string(path).map_err(|e| Error::file(path, e))?;
    let bad = |problem: PoseFileProblem| Error::Columns {
        path: path.to_owned(),
        problem: problem.into(),
    };
    let numbers: Option<Vec<f64>> = text.split_whitespace().map(|w| w.parse().ok()).collect();
    let numbers = numbers.ok_or_else(|| bad(PoseFileProblem::NotANumber))?;
    if numbers.len() != 16 {
        let found = numbers.len();
        return Err(bad(PoseFileProblem::Length { found }));
    }
    if numbers.iter().any(|n| !n.is_finite()) {
        return Ok(None);
    }
    let pose = motion_of_rows(&numbers[..12]);
    Ok(Some(pose.ok_or_else(|| bad(PoseFileProblem::NoRotation))?))
}
