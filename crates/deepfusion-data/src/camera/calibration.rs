//! A camera read from a calibration tool's file.

use super::lens::Lens;
use super::numbers::{self, Numbers};
use super::source::CalibrationSource;
use super::yaml;
use crate::{CalibrationPlace, Error, Result};
use deepfusion_geometry::{Distortion, Intrinsics};
use std::path::Path;

/// A camera according to its calibration file.
#[derive(Debug, Clone, PartialEq)]
pub struct CameraCalibration {
    /// Intrinsics of the original images, before any correction, in pixels.
    pub intrinsics: Intrinsics,
    /// Distortion of the lens.
    pub distortion: Distortion,
    /// Whether the calibration states the image size, or does not need it (an angle of view); otherwise it was taken from the images.
    pub size_in_file: bool,
    /// Where the calibration comes from.
    pub source: CalibrationSource,
    /// Whether the camera is only assumed, for lack of a calibration ([`crate::OpenOptions::assumed_camera`]).
    pub assumed: bool,
}

impl CameraCalibration {
    /// Reads OpenCV's FileStorage YAML (`camera_matrix`, `distortion_coefficients`), ROS `camera_info` YAML
    /// (from `camera_calibration`, or a printed message), Kalibr's camchain YAML (the first camera), or a
    /// text file with four numbers fx, fy, cx, cy or the nine of a camera matrix. `image_size` is used if the
    /// file does not state a size.
    ///
    /// # Errors
    /// [`Error::File`]; [`Error::CameraFile`] for a file of another kind, a lens model other than
    /// Brown-Conrady and the Kannala-Brandt fisheye model, or implausible intrinsics.
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

    /// A pinhole camera with the four numbers given, which come from `source`.
    ///
    /// # Errors
    /// [`Error::CameraFile`] if they are implausible.
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

    /// The same camera; if `any`, it applies to images of any size, as an angle of view does.
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

    /// Where the image size comes from, for errors.
    pub(crate) fn place(&self) -> CalibrationPlace {
        CalibrationPlace {
            source: self.source.clone(),
            field: if self.size_in_file {
                "the image size"
            } else {
                "the first image's size, as none is given"
            },
        }
    }

    /// The lens correction for its images.
    ///
    /// # Errors
    /// [`Error::CameraFile`] if camera matrix and distortion do not fit each other.
    pub fn lens(&self) -> Result<Lens> {
        Lens::new(self.intrinsics, &self.distortion).map_err(|problem| Error::CameraFile {
            by: self.source.clone(),
            problem: problem.into(),
        })
    }
}
