//! What a calibration is made of, and what it says.

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

/// A camera, and how sure it is.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Calibration {
    /// fx, fy, cx, cy in pixels, of the images as the camera gives them.
    pub intrinsics: Intrinsics,
    /// Which lens was fitted.
    pub model: LensModel,
    /// Its coefficients, in the order of [`LensModel::coefficients`].
    pub coefficients: Vec<f64>,
    /// Root mean square distance between corners as seen and as the camera explains them, over the views used, in pixels.
    pub rms_px: f64,
    /// One standard deviation of every number, if the corners' errors are independent.
    pub standard_errors: StandardErrors,
    /// From the image's left edge to its right at the principal point's height; none where the lens model shows nothing there.
    pub hfov_deg: Option<f64>,
    /// Every view in the order given, used or not.
    pub views: Vec<ViewFit>,
    /// Where in the image corners were seen.
    pub coverage: Coverage,
}

impl Calibration {
    /// The lens as the rest of the program takes it.
    ///
    /// # Errors
    /// [`NoDistortion`], for coefficients that are not finite.
    pub fn distortion(&self) -> Result<Distortion, NoDistortion> {
        match self.model {
            LensModel::BrownConrady => Distortion::from_opencv(&self.coefficients),
            LensModel::Fisheye => Distortion::from_fisheye(&self.coefficients),
        }
    }

    /// How many views were used.
    #[must_use]
    pub fn used(&self) -> usize {
        self.views.iter().filter(|v| v.used).count()
    }
}

/// Standard errors: σ̂ √diag (JᵀJ)⁻¹, with σ̂² the squared errors over the degrees of freedom.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct StandardErrors {
    /// Of fx, in pixels.
    pub fx: f64,
    /// Of fy, in pixels.
    pub fy: f64,
    /// Of cx, in pixels.
    pub cx: f64,
    /// Of cy, in pixels.
    pub cy: f64,
    /// Of the lens's coefficients.
    pub coefficients: Vec<f64>,
}

/// A view under the camera that was found.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct ViewFit {
    /// The picture's name.
    pub name: String,
    /// Whether it was used; else its corners disagree with all others.
    pub used: bool,
    /// Root mean square distance of its corners, in pixels; none where the board's pose is unknown.
    pub rms_px: Option<f64>,
    /// The board's distance from the camera, in metres; none where its pose, or the side of its squares, is unknown.
    pub distance_m: Option<f64>,
    /// The angle between the board's normal and the camera's axis, in degrees: 0 is parallel to the image.
    pub tilt_deg: Option<f64>,
}
