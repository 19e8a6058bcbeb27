//! A camera from the file that a calibration tool wrote.

use super::lens::Lens;
use super::numbers::{self, Numbers};
use super::source::CalibrationSource;
use super::yaml;
use crate::{CalibrationPlace, Error, Result};
use deepfusion_geometry::{Distortion, Intrinsics};
use std::path::Path;

/// What a calibration file says of a camera.
#[derive(Debug, Clone, PartialEq)]
pub struct CameraCalibration {
    /// Of the images as the camera gives them, before any correction, in pixels.
    pub intrinsics: Intrinsics,
    /// The lens.
    pub distortion: Distortion,
    /// Whether the image's size is said, or does not matter (an angle of view); else it was taken from the images.
    pub size_in_file: bool,
    /// What said it.
    pub source: CalibrationSource,
    /// Whether nothing said it ([`crate::OpenOptions::assumed_camera`]).
    pub assumed: bool,
}

impl CameraCalibration {
    /// Reads OpenCV's FileStorage YAML (`camera_matrix`, `distortion_coefficients`), ROS `camera_info` YAML
    /// (from `camera_calibration`, or a printed message), Kalibr's camchain YAML (the first camera), or a
    /// text file of four numbers fx, fy, cx, cy or of the nine of a camera matrix. Where it does not
    /// say the image's size, that is `image_size`.
    ///
    /// # Errors
    /// [`Error::File`], [`Error::CameraFile`] for a file of another kind, a lens model
    /// other than Brown and Conrady's and the fisheye model of Kannala and Brandt, or numbers that make no camera.
    pub fn read(path: &Path, image_size: (u32, u32)) -> Result<Self> {
        let text = std::fs::read(path).map_err(|e| Error::file(path, e))?;
        let text = String::from_utf8_lossy(&text);
        let extension = path.extension().and_then(|e| e.to_str()).unwrap_or("");
        let yaml = ["yaml", "yml"].contains(&extension.to_ascii_lowercase().as_str());
        let numbers = if yaml {
            yaml::parse(&text)
        } else {
            numbers::parse(&text)
        };
        let numbers = numbers.map_err(|problem| Error::CameraFile {
            by: path.into(),
            problem: problem.into(),
        })?;
        Self::from_numbers(numbers, image_size, path.into())
    }

    /// A pinhole camera of four given numbers; `source` gave them.
    ///
    /// # Errors
    /// [`Error::CameraFile`] where they make no camera.
    pub fn given(
        pinhole: [f64; 4],
        image_size: (u32, u32),
        source: CalibrationSource,
    ) -> Result<Self> {
        let numbers = Numbers {
            pinhole,
            distortion: Distortion::default(),
            size: None,
        };
        Self::from_numbers(numbers, image_size, source)
    }

    /// The same, known to hold for images of any size where `any`, as an angle of view does.
    pub(crate) fn for_any_size(self, any: bool) -> Self {
        Self {
            size_in_file: self.size_in_file || any,
            ..self
        }
    }

    fn from_numbers(
        numbers: Numbers,
        image_size: (u32, u32),
        source: CalibrationSource,
    ) -> Result<Self> {
        let size = numbers.size.unwrap_or(image_size);
        let intrinsics = Intrinsics::from_numbers(numbers.pinhole, size);
        if let Some(problem) = intrinsics.implausible() {
            return Err(Error::CameraFile {
                by: source,
                problem: problem.into(),
            });
        }
        Ok(Self {
            intrinsics,
            distortion: numbers.distortion,
            size_in_file: numbers.size.is_some(),
            source,
            assumed: false,
        })
    }

    /// The place that says the image's size, for errors.
    pub(crate) fn place(&self) -> CalibrationPlace {
        CalibrationPlace {
            source: self.source.clone(),
            field: if self.size_in_file {
                "the image's size"
            } else {
                "the first image's size, for want of one"
            },
        }
    }

    /// The correction of its images.
    ///
    /// # Errors
    /// [`Error::CameraFile`] where matrix and distortion do not fit each other.
    pub fn lens(&self) -> Result<Lens> {
        Lens::new(self.intrinsics, &self.distortion).map_err(|problem| Error::CameraFile {
            by: self.source.clone(),
            problem: problem.into(),
        })
    }
}
