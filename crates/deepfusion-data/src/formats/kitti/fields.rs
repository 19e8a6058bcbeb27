//! Reads the `name: values` lines of KITTI's calibration files.

use crate::formats::shared::poses::{is_rotation, motion_of_rows};
use crate::{CalibrationProblem, Error, Result};
use deepfusion_geometry::{Intrinsics, Se3};
use nalgebra::{Matrix3, Matrix3x4, Vector3};
use std::collections::HashMap;
use std::path::{Path, PathBuf};

/// The transform from rectified camera 0 to a camera, from its projection P = K [I | t]: t = K⁻¹ p₄.
pub(crate) fn cam_from_cam0(intrinsics: &Intrinsics, projection: &Matrix3x4<f64>) -> Se3 {
    let p4 = projection.column(3).into_owned();
    Se3::from_parts(&Matrix3::identity(), intrinsics.inverse_matrix() * p4)
}

/// The `name: values` lines of a calibration file.
pub(crate) struct Fields {
    path: PathBuf,
    values: HashMap<String, String>,
}

impl Fields {
    /// Reads a file; `None` if it does not exist.
    pub(crate) fn read(path: &Path) -> Result<Option<Self>> {
        let bytes = match std::fs::read(path) {
            Ok(bytes) => bytes,
            Err(e) if e.kind() == std::io::ErrorKind::NotFound => return Ok(None),
            Err(e) => return Err(Error::file(path, e)),
        };
        let text = String::from_utf8_lossy(&bytes);
        let values = text
            .lines()
            .filter_map(|line| line.split_once(':'))
            .map(|(name, values)| (name.trim().to_owned(), values.trim().to_owned()))
            .collect();
        Ok(Some(Self {
            path: path.to_owned(),
            values,
        }))
    }

    pub(crate) fn error(&self, field: &str, problem: CalibrationProblem) -> Error {
        Error::Calibration {
            path: self.path.clone(),
            field: field.to_owned(),
            problem,
        }
    }

    /// Exactly `N` finite numbers.
    pub(crate) fn numbers<const N: usize>(&self, field: &str) -> Result<[f64; N]> {
        let text = self
            .values
            .get(field)
            .ok_or_else(|| self.error(field, CalibrationProblem::NoLine))?;
        let mut numbers = [0.0; N];
        let mut count = 0;
        for word in text.split_whitespace() {
            let text = || word.to_owned();
            let number: f64 = word
                .parse()
                .map_err(|_| self.error(field, CalibrationProblem::NotANumber { text: text() }))?;
            if !number.is_finite() {
                return Err(self.error(field, CalibrationProblem::NotFinite { text: text() }));
            }
            if let Some(slot) = numbers.get_mut(count) {
                *slot = number;
            }
            count += 1;
        }
        if count != N {
            let problem = CalibrationProblem::Length {
                found: count,
                expected: N,
            };
            return Err(self.error(field, problem));
        }
        Ok(numbers)
    }

    /// A rigid transform from twelve numbers, the upper three rows of its matrix.
    pub(crate) fn motion(&self, field: &str) -> Result<Se3> {
        let motion = motion_of_rows(&self.numbers::<12>(field)?);
        motion.ok_or_else(|| self.error(field, CalibrationProblem::NotAMotion))
    }

    /// The intrinsics in a projection P = K [I | t], for images of this size.
    pub(crate) fn camera(
        &self,
        field: &str,
        projection: &Matrix3x4<f64>,
        (width, height): (u32, u32),
    ) -> Result<Intrinsics> {
        let intrinsics = Intrinsics {
            fx: projection[(0, 0)],
            fy: projection[(1, 1)],
            cx: projection[(0, 2)],
            cy: projection[(1, 2)],
            width,
            height,
        };
        match intrinsics.implausible() {
            Some(problem) => Err(self.error(field, problem.into())),
            None => Ok(intrinsics),
        }
    }

    /// A rotation, row by row, as printed.
    pub(crate) fn rotation(&self, field: &str) -> Result<Matrix3<f64>> {
        let rotation = Matrix3::from_row_slice(&self.numbers::<9>(field)?);
        if is_rotation(&rotation) {
            Ok(rotation)
        } else {
            Err(self.error(field, CalibrationProblem::NotARotation))
        }
    }

    /// Rotation `R` and translation `T`, each on its own line.
    pub(crate) fn rigid(&self) -> Result<(Matrix3<f64>, Vector3<f64>)> {
        let rotation = self.rotation("R")?;
        Ok((rotation, Vector3::from(self.numbers::<3>("T")?)))
    }

    pub(crate) fn size(&self, field: &str, value: f64) -> Result<u32> {
        if value.fract() == 0.0 && (1.0..=65_535.0).contains(&value) {
            Ok(value as u32)
        } else {
            Err(self.error(field, CalibrationProblem::NotASize { value }))
        }
    }
}
