//! The camera of an input: given, read from a calibration file, or assumed.

use std::path::{Path, PathBuf};
use std::sync::{Arc, OnceLock};

use deepfusion_data::{Camera, CameraCalibration, Lens, RgbImage, kitti::Calibration};
use deepfusion_geometry::Intrinsics;
use sha2::{Digest, Sha256};

use crate::error::UnfitCamera;
use crate::{Error, Result};

/// A camera given for all inputs.
#[derive(Debug, Clone, PartialEq)]
pub enum GivenCamera {
    /// fx, fy, cx, cy in pixels, for images of any size.
    Numbers([f64; 4]),
    /// The horizontal field of view in degrees, for images of any size.
    Hfov(f64),
    /// A calibration file; KITTI's may also be given by its folder.
    File(PathBuf),
}

/// The source of the inputs' camera.
#[derive(Debug, Clone)]
pub enum CameraSource {
    /// fx, fy, cx, cy as given, in pixels, for images of any size.
    Given([f64; 4]),
    /// The horizontal field of view as given, in degrees, for images of any size.
    Hfov(f64),
    /// KITTI's calibration file, for images of its size.
    File(Intrinsics),
    /// A calibration tool's file, with the lens whose distortion is removed.
    Lens(Arc<LensFile>),
    /// The training camera: the inputs are assumed to have its field of view.
    Trained(Intrinsics),
    /// The camera that the run learned, used in the same way.
    Learned(Intrinsics),
    /// The camera is unknown.
    Unknown,
}

impl CameraSource {
    /// The given camera, or else the one that the network was trained with or that its run `learned`.
    ///
    /// # Errors
    /// A file that cannot be read or is not a calibration.
    pub fn chosen(
        given: Option<&GivenCamera>,
        trained: Option<Intrinsics>,
        learned: bool,
    ) -> Result<Self> {
        Ok(match (given, trained) {
            (Some(GivenCamera::Numbers(k)), _) => Self::Given(*k),
            (Some(GivenCamera::Hfov(degrees)), _) => Self::Hfov(*degrees),
            (Some(GivenCamera::File(path)), _) => Self::of_file(path)?,
            (None, Some(k)) if learned => Self::Learned(k),
            (None, Some(k)) => Self::Trained(k),
            (None, None) => Self::Unknown,
        })
    }

    /// KITTI's calibration by its folder or file, or a calibration tool's file.
    fn of_file(path: &Path) -> Result<Self> {
        if !(path.is_dir()
            || path
                .file_name()
                .is_some_and(|name| name == Calibration::CAM_TO_CAM))
        {
            let bytes = std::fs::read(path).map_err(|e| deepfusion_data::Error::file(path, e))?;
            return Ok(Self::Lens(Arc::new(LensFile {
                path: path.to_owned(),
                sha256: format!("{:x}", Sha256::digest(&bytes)),
                lens: OnceLock::new(),
            })));
        }
        let folder = if path.is_dir() {
            path
        } else {
            path.parent().unwrap_or(Path::new("."))
        };
        Ok(Self::File(
            Calibration::read(folder, Camera::Left)?.intrinsics,
        ))
    }

    /// Width and height of the images that it was measured with, if its file contains them.
    #[must_use]
    pub fn image_size(&self) -> Option<(u32, u32)> {
        match self {
            Self::File(k) => Some((k.width, k.height)),
            Self::Lens(file) => file.image_size(),
            _ => None,
        }
    }

    /// The camera's source for an image without a camera of its own.
    #[must_use]
    pub fn from(&self) -> CameraFrom {
        match self {
            Self::Given(_) | Self::Hfov(_) | Self::File(_) | Self::Lens(_) => CameraFrom::Given,
            Self::Trained(_) => CameraFrom::Assumed,
            Self::Learned(_) => CameraFrom::Learned,
            Self::Unknown => CameraFrom::Unknown,
        }
    }

    /// The image as a pinhole camera would have taken it, with that camera and its source. EXIF takes precedence over an assumed camera.
    ///
    /// # Errors
    /// [`Error::Camera`] for the camera of images of another size.
    pub fn pinhole_image(&self, image: RgbImage, exif: Option<Intrinsics>) -> Result<PinholeImage> {
        if let Self::Lens(file) = self {
            let lens = file.lens_for(image.dimensions())?;
            return Ok(PinholeImage {
                image: lens.correct(image)?,
                camera: Some(lens.intrinsics()),
                from: self.from(),
                undistorted: lens.distorts(),
            });
        }
        let (camera, from) = match (self, exif) {
            (Self::Trained(_) | Self::Learned(_) | Self::Unknown, Some(camera)) => {
                (Some(camera), CameraFrom::Exif)
            }
            _ => (self.of(image.width(), image.height())?, self.from()),
        };
        Ok(PinholeImage {
            image,
            camera,
            from,
            undistorted: false,
        })
    }

    /// The camera of an image of this size.
    fn of(&self, width: u32, height: u32) -> Result<Option<Intrinsics>> {
        match self {
            Self::Given(k) => {
                let k = Intrinsics::from_numbers(*k, (width, height));
                match k.implausible() {
                    Some(why) => Err(Error::Camera(UnfitCamera::Implausible(why))),
                    None => Ok(Some(k)),
                }
            }
            Self::Hfov(degrees) => Ok(Some(Intrinsics::from_hfov(*degrees, (width, height)))),
            Self::File(k) if (k.width, k.height) != (width, height) => {
                Err(Error::Camera(UnfitCamera::OtherSize {
                    file: None,
                    made_for: (k.width, k.height),
                    image: (width, height),
                }))
            }
            Self::File(k) => Ok(Some(*k)),
            Self::Lens(_) => Ok(None),
            Self::Trained(k) | Self::Learned(k) => Ok(Some(with_the_view_of(k, width, height))),
            Self::Unknown => Ok(None),
        }
    }
}

/// An image as a pinhole camera would have taken it.
#[derive(Debug, Clone)]
pub struct PinholeImage {
    /// The pixels, after the lens's distortion was removed.
    pub image: RgbImage,
    /// The camera, if it is known or assumed.
    pub camera: Option<Intrinsics>,
    /// The camera's source.
    pub from: CameraFrom,
    /// Whether a distortion was removed, so that the pixels are not those of the file.
    pub undistorted: bool,
}

/// The source of an image's camera.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[non_exhaustive]
pub enum CameraFrom {
    /// It was given.
    Given,
    /// The recording's calibration.
    Recording,
    /// The image's EXIF.
    Exif,
    /// The network's run learned it.
    Learned,
    /// The training camera, assumed to be the image's.
    Assumed,
    /// The camera is unknown.
    Unknown,
}

impl CameraFrom {
    /// The word for it in the sidecar.
    #[must_use]
    pub fn word(self) -> &'static str {
        match self {
            Self::Given => "given",
            Self::Recording => "recording",
            Self::Exif => "exif",
            Self::Learned => "learned",
            Self::Assumed => "assumed",
            Self::Unknown => "unknown",
        }
    }

    /// Whether it is the image's own camera, and not a guess.
    #[must_use]
    pub fn is_known(self) -> bool {
        matches!(self, Self::Given | Self::Recording | Self::Exif)
    }
}

/// Largest offset of a principal point from the middle of the image, as a share of the image's side. A camera looks wrong only if both axes
/// exceed it in the same direction: the numbers of an image 1.5 times as large are off by 0.25 in both, those of a cropped image in one
/// axis only.
const MOST_OFF: f64 = 0.2;

/// Whether a camera's numbers look like those of images of another size.
#[must_use]
pub fn looks_of_another_size(k: &Intrinsics) -> bool {
    let off = |c: f64, size: u32| c / f64::from(size) - 0.5;
    let (x, y) = (off(k.cx, k.width), off(k.cy, k.height));
    x * y > 0.0 && x.abs().min(y.abs()) > MOST_OFF
}

/// A calibration tool's file: OpenCV's, ROS's, Kalibr's, or four numbers.
#[derive(Debug)]
pub struct LensFile {
    path: PathBuf,
    /// SHA-256 of the file: outputs depend on it.
    pub sha256: String,
    /// The lens, made for the first image's size.
    lens: OnceLock<((u32, u32), Lens)>,
}

impl LensFile {
    /// The size of the file's images, if it contains one.
    fn image_size(&self) -> Option<(u32, u32)> {
        // A file without a size can be read with any. What is wrong with the file is reported with the first image.
        const ANY: (u32, u32) = (1920, 1080);
        let calibration = CameraCalibration::read(&self.path, ANY).ok()?;
        let k = &calibration.intrinsics;
        calibration.size_in_file.then_some((k.width, k.height))
    }

    fn lens_for(&self, size: (u32, u32)) -> Result<&Lens> {
        let other_size = |made_for| {
            Error::Camera(UnfitCamera::OtherSize {
                file: Some(self.path.clone()),
                made_for,
                image: size,
            })
        };
        let (made_for, lens) = match self.lens.get() {
            Some(made) => made,
            None => {
                let calibration = CameraCalibration::read(&self.path, size)?;
                let k = &calibration.intrinsics;
                let calibrated = (k.width, k.height);
                // A lens takes memory for each pixel, so none is made for a size that no image has.
                if calibrated != size {
                    return Err(other_size(calibrated));
                }
                let made = (calibrated, calibration.lens()?);
                // If another thread was first, it made the same lens.
                self.lens.get_or_init(|| made)
            }
        };
        if *made_for == size {
            Ok(lens)
        } else {
            Err(other_size(*made_for))
        }
    }
}

/// A camera with the same horizontal field of view, pixel aspect ratio and relative height of the horizon. For an upright image, that is
/// the vertical field of view: the camera was turned, its lens is the same.
fn with_the_view_of(k: &Intrinsics, width: u32, height: u32) -> Intrinsics {
    let along = k.fx * f64::from(width.max(height)) / f64::from(k.width);
    let across = along * k.fy / k.fx;
    let (fx, fy) = if width < height {
        (across, along)
    } else {
        (along, across)
    };
    let centre = |c: f64, from: u32, to: u32| (c + 0.5) * f64::from(to) / f64::from(from) - 0.5;
    Intrinsics {
        fx,
        fy,
        cx: centre(k.cx, k.width, width),
        cy: centre(k.cy, k.height, height),
        width,
        height,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// An image of the training camera's size gets that camera, whatever the shape of its pixels; an upright image gets it turned.
    #[test]
    fn images_of_the_training_camera_have_its_intrinsics() {
        let k = Intrinsics {
            fx: 703.64,
            fy: 724.82,
            cx: 640.1,
            cy: 511.2,
            width: 1280,
            height: 1024,
        };
        let same = with_the_view_of(&k, 1280, 1024);
        for (a, b) in [
            (same.fx, k.fx),
            (same.fy, k.fy),
            (same.cx, k.cx),
            (same.cy, k.cy),
        ] {
            assert!((a - b).abs() < 1e-9, "{a} {b}");
        }
        let half = with_the_view_of(&k, 640, 512);
        assert!((half.fx - 0.5 * k.fx).abs() < 1e-9 && (half.fy - 0.5 * k.fy).abs() < 1e-9);
        let upright = with_the_view_of(&k, 1024, 1280);
        assert!((upright.fy - k.fx).abs() < 1e-9 && (upright.fx - k.fy).abs() < 1e-9);
    }

    #[test]
    fn a_calibration_may_contain_the_size_of_its_images() {
        let folder = tempfile::tempdir().unwrap();
        let size_of = |name: &str, text: &str| {
            let path = folder.path().join(name);
            std::fs::write(&path, text).unwrap();
            CameraSource::of_file(&path).unwrap().image_size()
        };
        let yaml = "image_width: 1280\nimage_height: 720\ncamera_matrix:\n  rows: 3\n  cols: 3\n  \
                    data: [900.0, 0.0, 640.0, 0.0, 900.0, 360.0, 0.0, 0.0, 1.0]\n";
        assert_eq!(size_of("camera.yaml", yaml), Some((1280, 720)));
        assert_eq!(size_of("intrinsics.txt", "900 900 640 360\n"), None);
        assert_eq!(size_of("broken.yaml", "?"), None);
        assert_eq!(CameraSource::Hfov(90.0).image_size(), None);
    }

    #[test]
    fn a_given_camera_precedes_the_networks_own() {
        let trained = Some(Intrinsics::centred(900.0, (1280, 1024)));
        let chosen = |given: Option<GivenCamera>, trained, learned| {
            CameraSource::chosen(given.as_ref(), trained, learned)
        };
        let numbers = GivenCamera::Numbers([900.0, 900.0, 639.5, 511.5]);
        for (given, trained, learned, from) in [
            (Some(numbers), trained, true, CameraFrom::Given),
            (
                Some(GivenCamera::Hfov(90.0)),
                None,
                false,
                CameraFrom::Given,
            ),
            (None, trained, true, CameraFrom::Learned),
            (None, trained, false, CameraFrom::Assumed),
            (None, None, false, CameraFrom::Unknown),
        ] {
            assert_eq!(chosen(given, trained, learned).unwrap().from(), from);
        }
        let nowhere = Some(GivenCamera::File("nowhere.yaml".into()));
        let error = chosen(nowhere, trained, false).unwrap_err();
        assert!(error.to_string().contains("nowhere.yaml"), "{error}");
    }
}
