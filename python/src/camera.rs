//! Cameras given in Python.

use std::sync::atomic::{AtomicBool, Ordering};

use deepfusion::geometry::{HFOV_DEG, Intrinsics};
use pyo3::exceptions::{PyTypeError, PyValueError};
use pyo3::prelude::*;

use crate::error::{Failure, warn};

/// Four numbers, or a matrix.
pub(crate) enum GivenCamera {
    /// fx, fy, cx, cy.
    Numbers([f64; 4]),
    /// K, row by row.
    Matrix([[f64; 3]; 3]),
    /// P = K [I | t], row by row.
    Projection([[f64; 4]; 3]),
}

impl<'py> FromPyObject<'_, 'py> for GivenCamera {
    type Error = PyErr;

    fn extract(camera: Borrowed<'_, 'py, PyAny>) -> PyResult<Self> {
        if let Ok(numbers) = camera.extract::<[f64; 4]>() {
            Ok(Self::Numbers(numbers))
        } else if let Ok(rows) = camera.extract::<[[f64; 3]; 3]>() {
            Ok(Self::Matrix(rows))
        } else if let Ok(rows) = camera.extract::<[[f64; 4]; 3]>() {
            Ok(Self::Projection(rows))
        } else {
            Err(PyTypeError::new_err(format!(
                "intrinsics: expected fx, fy, cx, cy in pixels, or the 3 x 3 matrix, found {}",
                camera.repr()?
            )))
        }
    }
}

impl GivenCamera {
    /// fx, fy, cx, cy.
    pub(crate) fn numbers(self) -> Result<[f64; 4], Failure> {
        let rows = match self {
            Self::Numbers(numbers) => return Ok(numbers),
            Self::Matrix(rows) => rows,
            Self::Projection(rows) => {
                if rows.iter().any(|row| row[3] != 0.0) {
                    return Err(Failure {
                        message: "intrinsics: this 3 x 4 matrix moves the camera: its last column is not 0".into(),
                        hint: Some("give P[:, :3], the camera's own matrix".into()),
                    });
                }
                rows.map(|[a, b, c, _]| [a, b, c])
            }
        };
        match rows {
            [[fx, skew, cx], [zero, fy, cy], last]
                if skew == 0.0 && zero == 0.0 && last == [0.0, 0.0, 1.0] =>
            {
                Ok([fx, fy, cx, cy])
            }
            rows => Err(Failure {
                message: format!("intrinsics: {rows:?} is not the matrix of a pinhole camera"),
                hint: Some("give rows fx 0 cx, 0 fy cy, 0 0 1".into()),
            }),
        }
    }
}

pub(crate) fn numbers_of(camera: Option<GivenCamera>) -> Result<Option<[f64; 4]>, Failure> {
    camera.map(GivenCamera::numbers).transpose()
}

/// Checks a camera's numbers and makes the camera of an image of this size.
pub(crate) fn checked([fx, fy, cx, cy]: [f64; 4], size: (u32, u32)) -> Result<Intrinsics, Failure> {
    let finite = [fx, fy, cx, cy].iter().all(|v| v.is_finite());
    if !(finite && fx > 0.0 && fy > 0.0) {
        return Err(Failure {
            message: format!("intrinsics: {:?} is no camera", (fx, fy, cx, cy)),
            hint: Some(
                "give fx, fy, cx, cy in pixels of this image, with fx and fy above 0".into(),
            ),
        });
    }
    Ok(Intrinsics::from_numbers([fx, fy, cx, cy], size))
}

/// The camera of the images as given by the caller.
#[derive(Clone, Copy)]
pub(crate) enum AskedCamera {
    /// Not given: the image's own camera is used, if known.
    Unsaid,
    /// fx, fy, cx, cy.
    Numbers([f64; 4]),
    /// The horizontal field of view in degrees.
    View(f64),
}

impl AskedCamera {
    pub(crate) fn new(intrinsics: Option<GivenCamera>, hfov_deg: Option<f64>) -> PyResult<Self> {
        match (numbers_of(intrinsics)?, hfov_deg) {
            (None, None) => Ok(Self::Unsaid),
            (Some(numbers), None) => Ok(Self::Numbers(numbers)),
            (None, Some(degrees)) if degrees > HFOV_DEG.0 && degrees < HFOV_DEG.1 => {
                Ok(Self::View(degrees))
            }
            (None, Some(degrees)) => Err(PyValueError::new_err(format!(
                "hfov_deg: expected degrees above {} and below {}, found {degrees}",
                HFOV_DEG.0, HFOV_DEG.1
            ))),
            (Some(_), Some(_)) => Err(PyValueError::new_err(
                "intrinsics and hfov_deg both describe the camera: give only one of them",
            )),
        }
    }

    /// The given camera for an image of this size.
    pub(crate) fn of(self, size: (u32, u32)) -> Result<Option<Intrinsics>, Failure> {
        match self {
            Self::Unsaid => Ok(None),
            Self::Numbers(numbers) => checked(numbers, size).map(Some),
            Self::View(degrees) => Ok(Some(Intrinsics::from_hfov(degrees, size))),
        }
    }
}

/// Whether Python was warned that an image's camera is unknown.
#[derive(Default)]
pub(crate) struct AssumedCamera(AtomicBool);

impl AssumedCamera {
    /// Warns once for all images of a network.
    pub(crate) fn warn(&self, py: Python<'_>) -> PyResult<()> {
        if self.0.swap(true, Ordering::Relaxed) {
            return Ok(());
        }
        warn(
            py,
            "an image's camera is unknown: assuming the training camera's lens, so depth in metres is only as accurate as that; \
             give intrinsics or hfov_deg",
        )
    }
}
