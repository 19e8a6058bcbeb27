//! The input of a calibration, and its result.

use crate::{Coverage, LensModel};
use deepfusion_geometry::{Distortion, Intrinsics, NoDistortion};
use nalgebra::Vector2;
use serde::Serialize;

/// The board in a picture.
#[derive(Debug, Clone, PartialEq)]
pub struct View {
    /// The picture's name.
    pub name: String,
    /// The board's inner corners in pixels, in the order of [`crate::Board::points`].
    pub corners: Vec<Vector2<f64>>,
}

/// A camera with its uncertainty.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Calibration {
    /// fx, fy, cx, cy in pixels of the images as the camera gives them.
    pub intrinsics: Intrinsics,
    /// The lens model that was fitted.
    pub model: LensModel,
    /// The lens's coefficients, in the order of [`LensModel::coefficients`].
    pub coefficients: Vec<f64>,
    /// Root mean square distance between detected corners and their projections by the camera, over the views used, in pixels.
    pub rms_px: f64,
    /// The standard error of every parameter, if the errors of the corners are independent.
    pub standard_errors: StandardErrors,
    /// Horizontal field of view at the principal point's height, in degrees; none if the lens model has no ray at an edge of the image.
    pub hfov_deg: Option<f64>,
    /// Every view in the order given, used or not.
    pub views: Vec<ViewFit>,
    /// Where in the image corners were seen.
    pub coverage: Coverage,
}

impl Calibration {
    /// The lens as a distortion of `deepfusion-geometry`.
    ///
    /// # Errors
    /// [`NoDistortion`], for coefficients that are not finite.
    pub fn distortion(&self) -> Result<Distortion, NoDistortion> {
        match self.model {
            LensModel::BrownConrady => Distortion::from_opencv(&self.coefficients),
            LensModel::Fisheye => Distortion::from_fisheye(&self.coefficients),
        }
    }

    /// Number of views used.
    #[must_use]
    pub fn used(&self) -> usize {
        self.views.iter().filter(|v| v.used).count()
    }
}

/// Standard errors: σ̂ √diag (JᵀJ)⁻¹, where σ̂² is the sum of squared errors over the degrees of freedom.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct StandardErrors {
    /// Standard error of fx, in pixels.
    pub fx: f64,
    /// Standard error of fy, in pixels.
    pub fy: f64,
    /// Standard error of cx, in pixels.
    pub cx: f64,
    /// Standard error of cy, in pixels.
    pub cy: f64,
    /// Standard errors of the lens's coefficients.
    pub coefficients: Vec<f64>,
}

/// How well a view fits the camera.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct ViewFit {
    /// The picture's name.
    pub name: String,
    /// Whether the view was used; otherwise its corners disagree with all other views.
    pub used: bool,
    /// Root mean square error of its corners, in pixels; none if the board's pose is unknown.
    pub rms_px: Option<f64>,
    /// Distance of the board from the camera, in metres; none if its pose, or the side of its squares, is unknown.
    pub distance_m: Option<f64>,
    /// Angle between the board's normal and the camera's axis, in degrees: 0 is parallel to the image. None if the pose is unknown.
    pub tilt_deg: Option<f64>,
}
