//! Where a recording's camera is looked for.

use super::calibration::CameraCalibration;
use crate::dataset::numbers_of_hfov;
use crate::dataset_toml::FolderConfig;
use crate::{DatasetKind, Error, OpenOptions, Result};
use std::path::Path;

/// Names under which a calibration is looked for beside the images, in this order.
const NAMES: [&str; 8] = [
    "calibration.yaml",
    "calibration.yml",
    "camera.yaml",
    "camera.yml",
    "camchain.yaml",
    "intrinsics.txt",
    "camera-intrinsics.txt",
    "calibration.txt",
];

/// What errors name in the place of a calibration's file or field where the caller gave the camera
/// ([`OpenOptions::intrinsics`], [`OpenOptions::hfov_deg`]).
pub const GIVEN_INTRINSICS: &str = "given intrinsics";

/// The camera of images of a size: given by the caller or in `dataset.toml`, or read from a file beside
/// them, or in the folder above.
///
/// # Errors
/// [`Error::NoCameraFile`] where nothing says it; [`Error::CameraFile`], [`Error::Config`].
pub(crate) fn find_camera(
    folder: &Path,
    config: &FolderConfig,
    options: &OpenOptions,
    size: (u32, u32),
    layout: DatasetKind,
) -> Result<CameraCalibration> {
    if let Some(given) = options.given_camera(size) {
        return CameraCalibration::given(given, size, Path::new(GIVEN_INTRINSICS));
    }
    if let Some(given) = config.intrinsics {
        return CameraCalibration::given(given, size, &config.path);
    }
    if let Some(hfov_deg) = config.hfov_deg {
        let given = numbers_of_hfov(hfov_deg, size);
        return CameraCalibration::given(given, size, &config.path);
    }
    let named = config.calibration.as_ref();
    let mut file = config.find(folder, "calibration", named, &NAMES)?;
    if file.is_none()
        && let Some(above) = folder.parent()
    {
        file = config.find(above, "calibration", None, &NAMES)?;
    }
    match file {
        Some(file) => CameraCalibration::read(&file, size),
        None => Err(Error::NoCameraFile {
            path: folder.join(NAMES[0]),
            layout,
        }),
    }
}
