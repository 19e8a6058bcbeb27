//! Where a recording's camera is looked for.

use super::calibration::CameraCalibration;
use crate::dataset_toml::FolderConfig;
use crate::{Error, OpenOptions, Result};
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

/// The camera of images of a size: given on the command line or in `dataset.toml`, or read from a file beside
/// them, or in the folder above.
///
/// # Errors
/// [`Error::Missing`] where nothing says it, with `remedy`; [`Error::CameraFile`], [`Error::Config`].
pub(crate) fn find_camera(
    folder: &Path,
    config: &FolderConfig,
    options: &OpenOptions,
    size: (u32, u32),
    remedy: &'static str,
) -> Result<CameraCalibration> {
    if let Some(given) = options.intrinsics {
        return CameraCalibration::given(given, size, Path::new("--intrinsics"));
    }
    if let Some(given) = config.intrinsics {
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
        None => Err(Error::Missing {
            path: folder.join(NAMES[0]),
            what: "the camera's fx, fy, cx, cy",
            remedy,
        }),
    }
}
