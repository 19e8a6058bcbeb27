mod fisheye;

use deepfusion_hint::Hint;
use nalgebra::{Matrix2, Vector2};
use serde::{Deserialize, Serialize};

/// Largest number of Newton steps; inside the image of a usual lens, 4 to 6 are needed.
const MAX_STEPS: usize = 30;
/// Accuracy of the distorted point, in units of the focal length: about a millionth of a pixel.
const TOLERANCE: f64 = 1e-10;

/// Lens distortion, radial and tangential, by Brown and Conrady, in the form of OpenCV's first eight coefficients and ROS's `plumb_bob` and
/// `rational_polynomial`.
///
/// A point of the camera frame with x = X/Z, y = Y/Z, r² = x² + y² appears at
///
/// - g = (1 + k₁r² + k₂r⁴ + k₃r⁶) / (1 + k₄r² + k₅r⁴ + k₆r⁶)
/// - x' = g·x + 2p₁xy + p₂(r² + 2x²)
/// - y' = g·y + p₁(r² + 2y²) + 2p₂xy
///
/// and its pixel is (fx·x' + cx, fy·y' + cy). For a fisheye lens, [`Self::fisheye`] applies instead.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
pub struct Distortion {
    /// Radial coefficients of r², r⁴ and r⁶ in the numerator: k₁, k₂, k₃.
    pub radial: [f64; 3],
    /// Tangential coefficients: p₁, p₂.
    pub tangential: [f64; 2],
    /// Radial coefficients in the denominator: k₄, k₅, k₆.
    pub rational: [f64; 3],
    /// k₁, k₂, k₃, k₄ of a fisheye lens by Kannala and Brandt (`cv::fisheye`, Kalibr's `equidistant`): a ray at the angle θ = atan(r) from
    /// the axis appears at θ_d = θ(1 + k₁θ² + k₂θ⁴ + k₃θ⁶ + k₄θ⁸), so x' = θ_d/r·x and y' = θ_d/r·y. The other coefficients are then
    /// ignored.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub fisheye: Option<[f64; 4]>,
}

/// Why coefficients do not describe a lens.
#[derive(Debug, Clone, Copy, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum NoDistortion {
    /// A coefficient is NaN or infinite.
    #[error("a coefficient is {0}")]
    NotFinite(f64),
    /// None of OpenCV's models has this number of coefficients.
    #[error("{0} coefficients, expected k1, k2, p1, p2[, k3[, k4, k5, k6]]")]
    Count(usize),
    /// A fisheye lens has another number of coefficients.
    #[error("{0} coefficients, expected k1, k2, k3, k4 of a fisheye lens")]
    FisheyeCount(usize),
    /// OpenCV's further coefficients are not zero.
    #[error("thin prism or tilt coefficients are not supported")]
    ThinPrism,
}

impl Hint for NoDistortion {
    fn hint(&self) -> Option<String> {
        Some("calibrate with k1, k2, p1, p2 and k3, or a fisheye lens with k1 to k4".into())
    }
}

impl Distortion {
    /// Makes a lens from coefficients in OpenCV's order k₁, k₂, p₁, p₂, k₃, k₄, k₅, k₆; 0, 4, 5 or 8 of them. More (thin prism, tilt) are
    /// accepted only if they are all zero.
    ///
    /// # Errors
    /// [`NoDistortion`], with the reason.
    pub fn from_opencv(coefficients: &[f64]) -> Result<Self, NoDistortion> {
        if let Some(bad) = coefficients.iter().find(|c| !c.is_finite()) {
            return Err(NoDistortion::NotFinite(*bad));
        }
        let used = match coefficients.len() {
            0 | 4 | 5 | 8 => coefficients,
            12 | 14 if coefficients[8..].iter().all(|c| *c == 0.0) => &coefficients[..8],
            12 | 14 => return Err(NoDistortion::ThinPrism),
            n => return Err(NoDistortion::Count(n)),
        };
        let at = |i: usize| used.get(i).copied().unwrap_or(0.0);
        Ok(Self {
            radial: [at(0), at(1), at(4)],
            tangential: [at(2), at(3)],
            rational: [at(5), at(6), at(7)],
            fisheye: None,
        })
    }

    /// Makes a fisheye lens from the coefficients k₁, k₂, k₃, k₄ of `cv::fisheye` and Kalibr's `equidistant`. All zero is a valid lens,
    /// too: r' = θ.
    ///
    /// # Errors
    /// [`NoDistortion`], with the reason.
    pub fn from_fisheye(coefficients: &[f64]) -> Result<Self, NoDistortion> {
        let Ok(k) = <[f64; 4]>::try_from(coefficients) else {
            return Err(NoDistortion::FisheyeCount(coefficients.len()));
        };
        match k.iter().find(|c| !c.is_finite()) {
            Some(bad) => Err(NoDistortion::NotFinite(*bad)),
            None => Ok(Self {
                fisheye: Some(k),
                ..Self::default()
            }),
        }
    }

    /// Whether the lens leaves all points unchanged.
    #[must_use]
    pub fn is_none(&self) -> bool {
        *self == Self::default()
    }

    /// The distorted position of an undistorted point; both in normalised coordinates (x = X/Z).
    #[must_use]
    pub fn distort(&self, ideal: &Vector2<f64>) -> Vector2<f64> {
        match &self.fisheye {
            Some(k) => fisheye::distort(k, ideal),
            None => self.with_slope(ideal).0,
        }
    }

    /// The undistorted point whose distorted position is `seen`; `None` if there is none near it. Outside the image that the polynomial was
    /// fitted to, it may not be invertible.
    #[must_use]
    pub fn undistort(&self, seen: &Vector2<f64>) -> Option<Vector2<f64>> {
        if let Some(k) = &self.fisheye {
            return fisheye::undistort(k, seen);
        }
        let mut ideal = *seen;
        for _ in 0..MAX_STEPS {
            let (shown, slope) = self.with_slope(&ideal);
            // Beyond the fold, the order of neighbouring points is reversed.
            if slope.determinant() <= 0.0 {
                return None;
            }
            let off = shown - seen;
            if off.norm() < TOLERANCE {
                return Some(ideal);
            }
            ideal -= slope.try_inverse()? * off;
        }
        None
    }

    /// The distorted position of a point, and its derivatives: ∂(x', y') / ∂(x, y).
    fn with_slope(&self, p: &Vector2<f64>) -> (Vector2<f64>, Matrix2<f64>) {
        let (x, y, r2) = (p.x, p.y, p.norm_squared());
        let [p1, p2] = self.tangential;
        let polynomial = |k: &[f64; 3]| 1.0 + r2 * (k[0] + r2 * (k[1] + r2 * k[2]));
        let derivative = |k: &[f64; 3]| k[0] + r2 * (2.0 * k[1] + r2 * 3.0 * k[2]);
        let (above, below) = (polynomial(&self.radial), polynomial(&self.rational));
        let g = above / below;
        // dg / dr²
        let dg = (derivative(&self.radial) - g * derivative(&self.rational)) / below;
        let shown = Vector2::new(
            g * x + 2.0 * p1 * x * y + p2 * (r2 + 2.0 * x * x),
            g * y + p1 * (r2 + 2.0 * y * y) + 2.0 * p2 * x * y,
        );
        let across = 2.0 * (dg * x * y + p1 * x + p2 * y);
        let slope = Matrix2::new(
            g + 2.0 * (dg * x * x + p1 * y + 3.0 * p2 * x),
            across,
            across,
            g + 2.0 * (dg * y * y + 3.0 * p1 * y + p2 * x),
        );
        (shown, slope)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    /// EuRoC's cam0, a wide lens.
    fn euroc() -> Distortion {
        Distortion::from_opencv(&[-0.28340811, 0.07395907, 0.00019359, 1.76187114e-05]).unwrap()
    }

    #[test]
    fn coefficients_are_counted() {
        assert!(Distortion::from_opencv(&[]).unwrap().is_none());
        let five = Distortion::from_opencv(&[0.1, 0.2, 0.3, 0.4, 0.5]).unwrap();
        assert_eq!(
            (five.radial, five.tangential),
            ([0.1, 0.2, 0.5], [0.3, 0.4])
        );
        let mut twelve = [0.1; 12];
        assert!(Distortion::from_opencv(&twelve).is_err());
        twelve[8..].fill(0.0);
        assert_eq!(Distortion::from_opencv(&twelve).unwrap().rational, [0.1; 3]);
        assert_eq!(
            Distortion::from_opencv(&[0.1; 3]).unwrap_err(),
            NoDistortion::Count(3)
        );
        assert!(Distortion::from_opencv(&[f64::NAN; 4]).is_err());
    }

    #[test]
    fn behind_the_fold_there_is_no_point() {
        // x(1 - x²) is 0.385 at most, at x = 0.577.
        let fold = Distortion::from_opencv(&[-1.0, 0.0, 0.0, 0.0]).unwrap();
        assert!(fold.undistort(&Vector2::new(0.3, 0.0)).is_some());
        assert_eq!(fold.undistort(&Vector2::new(0.5, 0.0)), None);
    }

    #[test]
    fn a_fisheye_lens_has_four_coefficients() {
        let lens = Distortion::from_fisheye(&[0.1, 0.0, 0.0, 0.0]).unwrap();
        assert!(!lens.is_none());
        // Without coefficients it still distorts: an angle of 45 degrees appears at pi/4, not at tan(pi/4) = 1.
        let plain = Distortion::from_fisheye(&[0.0; 4]).unwrap();
        assert!(!plain.is_none());
        let seen = plain.distort(&Vector2::new(0.6, 0.8));
        assert!((seen.norm() - std::f64::consts::FRAC_PI_4).abs() < 1e-15);
        assert_eq!(
            Distortion::from_fisheye(&[0.1; 5]).unwrap_err(),
            NoDistortion::FisheyeCount(5)
        );
        assert!(Distortion::from_fisheye(&[0.1, 0.1, 0.1, f64::INFINITY]).is_err());
    }

    proptest! {
        #[test]
        fn undistortion_inverts_distortion(x in -0.8..0.8f64, y in -0.5..0.5f64) {
            let ideal = Vector2::new(x, y);
            let back = euroc().undistort(&euroc().distort(&ideal)).unwrap();
            prop_assert!((back - ideal).norm() < 1e-9, "{back}");
        }

        /// The slope agrees with central differences. Their error is h² times the third derivative (some tens at most here), 1e-9, plus
        /// that of rounding, 1e-16 / h.
        #[test]
        fn the_slope_is_the_derivative(
            x in -0.5..0.5f64, y in -0.5..0.5f64, k in proptest::collection::vec(-0.2..0.2f64, 8),
        ) {
            let lens = Distortion::from_opencv(&k).unwrap();
            let p = Vector2::new(x, y);
            let h = 1e-5;
            for (column, step) in [Vector2::new(h, 0.0), Vector2::new(0.0, h)].into_iter().enumerate() {
                let measured = (lens.distort(&(p + step)) - lens.distort(&(p - step))) / (2.0 * h);
                let slope = lens.with_slope(&p).1.column(column).into_owned();
                prop_assert!((measured - slope).norm() < 1e-7, "{measured} {slope}");
            }
        }

        #[test]
        fn any_input_terminates(k in proptest::collection::vec(-10.0..10.0f64, 8), x in -5.0..5.0f64, y in -5.0..5.0f64) {
            let lens = Distortion::from_opencv(&k).unwrap();
            let seen = Vector2::new(x, y);
            if let Some(ideal) = lens.undistort(&seen) {
                prop_assert!((lens.distort(&ideal) - seen).norm() < 1e-9);
            }
        }
    }
}
