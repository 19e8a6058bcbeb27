//! Finds a recording's camera calibration.

use super::calibration::CameraCalibration;
use super::source::CalibrationSource;
use crate::dataset::numbers_of_hfov;
use crate::dataset_toml::FolderConfig;
use crate::names::name_of;
use crate::{CameraProblem, CameraWarning, DataWarning, DatasetKind, Error, OpenOptions, Result};
use deepfusion_images::{ExifCamera, exif_camera};
use deepfusion_logs::GoproLens;
use std::path::{Path, PathBuf};

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

/// KITTI raw's calibration file, which lies above the drives.
const KITTI_RAW: &str = "calib_cam_to_cam.txt";

/// The path of a calibration file beside an image, in the folder above or, for KITTI, some folders further up. The file is not read.
#[must_use]
pub fn calibration_near(image: &Path) -> Option<PathBuf> {
    let image = std::path::absolute(image).ok()?;
    let folders = image.ancestors().skip(1).take(5).enumerate();
    let mut files = folders.flat_map(|(above, folder)| {
        let beside = if above < 2 { &NAMES[..] } else { &[] };
        let names = beside.iter().chain([&KITTI_RAW]);
        names.map(|name| folder.join(name)).collect::<Vec<_>>()
    });
    files.find(|file| file.is_file())
}

/// The files from a camera, which may contain a description of it.
#[derive(Debug, Clone, Copy)]
pub(crate) enum Pictures<'a> {
    /// Images, which may have an EXIF block.
    Images(&'a [PathBuf]),
    /// A video, and its entry about a GoPro's lens, if any.
    Video(&'a Path, Option<&'a GoproLens>),
}

/// The camera of images of the given size. In order of precedence: given by the caller, given in `dataset.toml`, read from a file beside
/// the images, the same two in the folder above, described in the `pictures` themselves, assumed. The last two add a warning to `warnings`.
///
/// # Errors
/// [`Error::NoCameraFile`] if there is none of these; [`Error::CameraFile`], [`Error::Config`].
pub(crate) fn find_camera(
    folder: &Path,
    config: &FolderConfig,
    options: &OpenOptions,
    size: (u32, u32),
    layout: DatasetKind,
    pictures: Pictures<'_>,
    warnings: &mut Vec<DataWarning>,
) -> Result<CameraCalibration> {
    if let Some(given) = options.given_camera(size) {
        let given = CameraCalibration::given(given, size, CalibrationSource::Given)?;
        return Ok(given.for_any_size(options.intrinsics.is_none()));
    }
    if let Some(file) = &options.calibration {
        return CameraCalibration::read(file, size);
    }
    if let Some(given) = in_numbers(config, size)? {
        return Ok(given);
    }
    let named = config.calibration.as_ref();
    let mut file = config.find(folder, "calibration", named, &NAMES)?;
    if file.is_none()
        && let Some(above) = &config.above
        && let Some(given) = in_numbers(above, size)?
    {
        return Ok(given);
    }
    if file.is_none()
        && let Some(above) = folder.parent()
    {
        file = config.find(above, "calibration", None, &NAMES)?;
    }
    if let Some(file) = file {
        return CameraCalibration::read(&file, size);
    }
    let described = match pictures {
        Pictures::Images(images) => by_exif(images, size)?,
        Pictures::Video(file, Some(lens)) => by_gopro(file, lens, size)?,
        Pictures::Video(_, None) => None,
    };
    if let Some((calibration, warning)) = described {
        warnings.push(warning.into());
        return Ok(calibration);
    }
    match options.assumed_numbers(size) {
        Some(assumed) => {
            let [fx, fy, ..] = assumed;
            warnings.push(CameraWarning::Assumed { fx, fy }.into());
            let calibration = CameraCalibration::given(assumed, size, folder.into())?;
            Ok(CameraCalibration {
                assumed: true,
                ..calibration
            })
        }
        None => Err(Error::NoCameraFile {
            path: folder.to_owned(),
            layout,
        }),
    }
}

/// The camera given as numbers in a `dataset.toml`.
fn in_numbers(config: &FolderConfig, size: (u32, u32)) -> Result<Option<CameraCalibration>> {
    let by = CalibrationSource::from(config.path.as_path());
    if let Some(given) = config.intrinsics {
        return CameraCalibration::given(given, size, by).map(Some);
    }
    let Some(hfov_deg) = config.hfov_deg else {
        return Ok(None);
    };
    let given = CameraCalibration::given(numbers_of_hfov(hfov_deg, size), size, by)?;
    Ok(Some(given.for_any_size(true)))
}

/// How many images of a recording are checked for the same focal length.
const CHECKED: usize = 9;

/// The camera according to the images' EXIF blocks, with a warning about that; `None` if the first image's block does not describe it.
///
/// # Errors
/// [`Error::CameraFile`] if another of the images checked was taken with another focal length.
fn by_exif(
    images: &[PathBuf],
    size: (u32, u32),
) -> Result<Option<(CameraCalibration, CameraWarning)>> {
    let camera_of = |path: &PathBuf| exif_camera(path, size);
    let Some((path, first)) = images
        .first()
        .and_then(|path| Some((path, camera_of(path)?)))
    else {
        return Ok(None);
    };
    let checked = (1..CHECKED).map(|i| &images[i * (images.len() - 1) / (CHECKED - 1)]);
    for (other, camera) in checked.filter_map(|path| Some((path, camera_of(path)?))) {
        // The 35 mm equivalent focal length is in whole millimetres.
        if (camera.intrinsics.fx / first.intrinsics.fx - 1.0).abs() > 1e-6 {
            return Err(Error::CameraFile {
                by: other.as_path().into(),
                problem: CameraProblem::Zoomed {
                    entry: camera.by,
                    other_entry: first.by,
                    other: name_of(path),
                },
            });
        }
    }
    let ExifCamera {
        intrinsics: k,
        by,
        action_camera,
        turned,
    } = first;
    let warning = CameraWarning::ByExif {
        image: path.clone(),
        by,
        focal_px: k.fx,
        action_camera,
        turned,
    };
    let calibration =
        CameraCalibration::given([k.fx, k.fy, k.cx, k.cy], size, path.as_path().into())?;
    Ok(Some((calibration, warning)))
}

/// The camera according to a GoPro's video, with a warning about that; `None` for lenses other than the linear one.
fn by_gopro(
    file: &Path,
    lens: &GoproLens,
    size: (u32, u32),
) -> Result<Option<(CameraCalibration, CameraWarning)>> {
    let Some(focal_px) = lens.focal_px(size) else {
        return Ok(None);
    };
    let hfov_deg = 2.0 * (f64::from(size.0) / 2.0 / focal_px).atan().to_degrees();
    let calibration = CameraCalibration::given(numbers_of_hfov(hfov_deg, size), size, file.into())?;
    let warning = CameraWarning::ByGopro {
        video: file.to_owned(),
        model: lens.model.clone(),
        diagonal_deg: lens.diagonal_deg,
        focal_px,
    };
    Ok(Some((calibration, warning)))
}
