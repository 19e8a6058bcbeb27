//! The camera of an input: given, read from a calibration file, or assumed.

use std::path::{Path, PathBuf};
use std::sync::{Arc, OnceLock};

use deepfusion_data::{Camera, CameraCalibration, Lens, RgbImage, kitti::Calibration};
use deepfusion_geometry::Intrinsics;
use sha2::{Digest, Sha256};

use crate::error::UnfitCamera;
use crate::{Error, Result};

/// The camera that was given for all inputs.
#[derive(Debug, Clone, PartialEq)]
pub enum GivenCamera {
    /// fx, fy, cx, cy in pixels, for images of any size.
    Numbers([f64; 4]),
    /// The field of view from left to right in degrees, for images of any size.
    Hfov(f64),
    /// A calibration file; of KITTI's also the folder.
    File(PathBuf),
}

/// Where the inputs' camera comes from.
#[derive(Debug, Clone)]
pub enum CameraSource {
    /// fx, fy, cx, cy that were given, in pixels, for images of any size.
    Given([f64; 4]),
    /// The field of view from left to right that was given, in degrees, for images of any size.
    Hfov(f64),
    /// KITTI's calibration file, for images of its size.
    File(Intrinsics),
    /// A calibration tool's file, with the lens that is undone.
    Lens(Arc<LensFile>),
    /// The camera trained with: the inputs are taken to see what it saw.
    Trained(Intrinsics),
    /// The camera that the run learned, in the same way.
    Learned(Intrinsics),
    /// Nothing is known.
    Unknown,
}

impl CameraSource {
    /// The camera that was given; where none was, the one that the network was trained with, or that its run `learned`.
    ///
    /// # Errors
    /// A file that cannot be read, or is no calibration.
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

    /// KITTI's calibration by its folder or its file, or a calibration tool's file.
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

    /// Width and height of the images that it was measured with, where its file says them.
    #[must_use]
    pub fn image_size(&self) -> Option<(u32, u32)> {
        match self {
            Self::File(k) => Some((k.width, k.height)),
            Self::Lens(file) => file.image_size(),
            _ => None,
        }
    }

    /// What it is to an image that says nothing itself.
    #[must_use]
    pub fn from(&self) -> CameraFrom {
        match self {
            Self::Given(_) | Self::Hfov(_) | Self::File(_) | Self::Lens(_) => CameraFrom::Given,
            Self::Trained(_) => CameraFrom::Assumed,
            Self::Learned(_) => CameraFrom::Learned,
            Self::Unknown => CameraFrom::Unknown,
        }
    }

    /// The image as a pinhole camera would have taken it, that camera, and where it comes from. What EXIF says
    /// comes before what would only be assumed.
    ///
    /// # Errors
    /// [`Error::Camera`] for a camera of other images.
    pub fn see(&self, image: RgbImage, exif: Option<Intrinsics>) -> Result<PinholeImage> {
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
    /// The pixels, without the lens.
    pub image: RgbImage,
    /// The camera, where it is known or assumed.
    pub camera: Option<Intrinsics>,
    /// Where that comes from.
    pub from: CameraFrom,
    /// Whether a distortion was undone: then the pixels are not those of the file.
    pub undistorted: bool,
}

/// Where an image's camera comes from.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[non_exhaustive]
pub enum CameraFrom {
    /// Who started it said it.
    Given,
    /// The recording says it.
    Recording,
    /// The image's EXIF says it.
    Exif,
    /// The network's run learned it.
    Learned,
    /// The one that the network was trained with is taken for it.
    Assumed,
    /// Nothing says it.
    Unknown,
}

impl CameraFrom {
    /// One word for the sidecar.
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

/// How far a principal point may lie from the middle of the image, as a share of its side, in both axes and the same way. Numbers of an
/// image half as large again are 0.25 off, those of a cut image in one axis alone.
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
    /// Of the file: outputs made with another are others.
    pub sha256: String,
    /// Made for the first image's size.
    lens: OnceLock<((u32, u32), Lens)>,
}

impl LensFile {
    /// The size of its images, where it says one.
    fn image_size(&self) -> Option<(u32, u32)> {
        // A file that says none is read with any; what is wrong with it is said when the first image is there.
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
                let said = (k.width, k.height);
                // A lens takes memory for each pixel: not for a size that no image has.
                if said != size {
                    return Err(other_size(said));
                }
                let made = (said, calibration.lens()?);
                // Another thread may have been first: it made the same.
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

/// A camera of the same field of view from left to right, pixels of the same shape, the same height of the horizon. Of an upright
/// image the field of view is that from top to bottom: the camera was turned, not its lens changed.
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

    /// An image of the training camera has that camera, whatever the shape of its pixels, and upright it is turned.
    #[test]
    fn the_training_cameras_own_images_have_its_numbers() {
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
    fn a_calibration_may_say_the_size_of_its_images() {
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
    fn what_was_given_comes_before_what_the_network_knows() {
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
