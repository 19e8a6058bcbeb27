//! From points of the camera frame to pixels, with all derivatives.

use deepfusion_geometry::{Distortion, Intrinsics};
use nalgebra::{Matrix2x3, SMatrix, Vector2, Vector3};
use serde::Serialize;
use std::f64::consts::PI;

/// The lens model.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum LensModel {
    /// Brown–Conrady: k₁, k₂, p₁, p₂, k₃.
    #[default]
    BrownConrady,
    /// Kannala–Brandt, for fisheye lenses: k₁, k₂, k₃, k₄.
    Fisheye,
}

impl LensModel {
    /// Names of its coefficients, in OpenCV's order.
    #[must_use]
    pub fn coefficients(self) -> &'static [&'static str] {
        match self {
            Self::BrownConrady => &["k1", "k2", "p1", "p2", "k3"],
            Self::Fisheye => &["k1", "k2", "k3", "k4"],
        }
    }

    /// Its name for people to read.
    #[must_use]
    pub fn label(self) -> &'static str {
        match self {
            Self::BrownConrady => "Brown-Conrady",
            Self::Fisheye => "fisheye (Kannala-Brandt)",
        }
    }

    /// Number of the camera's parameters: fx, fy, cx, cy and the coefficients.
    pub(crate) fn numbers(self) -> usize {
        4 + self.coefficients().len()
    }
}

/// Greatest number of parameters of a camera.
pub(crate) const MOST: usize = 9;
/// Rays nearer to the axis than this (x² + y² at z = 1) count as on it: there the derivatives are limits.
const ON_AXIS: f64 = 1e-16;

/// The parameters to be estimated: fx, fy, cx, cy, coefficients; unused ones are 0.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Camera {
    pub(crate) model: LensModel,
    pub(crate) numbers: [f64; MOST],
}

/// A pixel and its derivatives.
pub(crate) struct Projected {
    pub(crate) pixel: Vector2<f64>,
    /// ∂ pixel / ∂ parameters of the camera.
    pub(crate) by_camera: SMatrix<f64, 2, MOST>,
    /// ∂ pixel / ∂ point of the camera frame.
    pub(crate) by_point: Matrix2x3<f64>,
}

impl Camera {
    pub(crate) fn without_distortion(model: LensModel, pinhole: [f64; 4]) -> Self {
        let mut numbers = [0.0; MOST];
        numbers[..4].copy_from_slice(&pinhole);
        Self { model, numbers }
    }

    pub(crate) fn coefficients(&self) -> &[f64] {
        &self.numbers[4..self.model.numbers()]
    }

    pub(crate) fn intrinsics(&self, size: (u32, u32)) -> Intrinsics {
        let [fx, fy, cx, cy, ..] = self.numbers;
        Intrinsics::from_numbers([fx, fy, cx, cy], size)
    }

    /// The lens; `None` for coefficients that are not finite.
    pub(crate) fn distortion(&self) -> Option<Distortion> {
        let k = self.coefficients();
        match self.model {
            LensModel::BrownConrady => Distortion::from_opencv(k).ok(),
            LensModel::Fisheye => Distortion::from_fisheye(k).ok(),
        }
    }

    /// The pixel of a point of the camera frame; `None` if the camera does not see it, because it is behind the camera.
    pub(crate) fn project(&self, point: &Vector3<f64>) -> Option<Projected> {
        let [fx, fy, cx, cy, ..] = self.numbers;
        let (seen, by_coefficients, by_point) = match self.model {
            LensModel::BrownConrady => self.brown(point)?,
            LensModel::Fisheye => self.fisheye(point)?,
        };
        let mut by_camera = SMatrix::<f64, 2, MOST>::zeros();
        by_camera[(0, 0)] = seen.x;
        by_camera[(1, 1)] = seen.y;
        by_camera[(0, 2)] = 1.0;
        by_camera[(1, 3)] = 1.0;
        for i in 0..5 {
            by_camera[(0, 4 + i)] = fx * by_coefficients[(0, i)];
            by_camera[(1, 4 + i)] = fy * by_coefficients[(1, i)];
        }
        let mut slope = by_point;
        slope.row_mut(0).scale_mut(fx);
        slope.row_mut(1).scale_mut(fy);
        Some(Projected {
            pixel: Vector2::new(fx * seen.x + cx, fy * seen.y + cy),
            by_camera,
            by_point: slope,
        })
    }

    /// The normalised image point by Brown–Conrady, and its derivatives by the coefficients and by the point.
    fn brown(
        &self,
        point: &Vector3<f64>,
    ) -> Option<(Vector2<f64>, SMatrix<f64, 2, 5>, Matrix2x3<f64>)> {
        if point.z <= 1e-9 {
            return None;
        }
        let [_, _, _, _, k1, k2, p1, p2, k3] = self.numbers;
        let (x, y) = (point.x / point.z, point.y / point.z);
        let r2 = x * x + y * y;
        let g = 1.0 + r2 * (k1 + r2 * (k2 + r2 * k3));
        let dg = k1 + r2 * (2.0 * k2 + r2 * 3.0 * k3);
        let seen = Vector2::new(
            g * x + 2.0 * p1 * x * y + p2 * (r2 + 2.0 * x * x),
            g * y + p1 * (r2 + 2.0 * y * y) + 2.0 * p2 * x * y,
        );
        let (r4, r6) = (r2 * r2, r2 * r2 * r2);
        let by_coefficients = SMatrix::<f64, 2, 5>::from_row_slice(&[
            x * r2,
            x * r4,
            2.0 * x * y,
            r2 + 2.0 * x * x,
            x * r6,
            y * r2,
            y * r4,
            r2 + 2.0 * y * y,
            2.0 * x * y,
            y * r6,
        ]);
        let across = 2.0 * (dg * x * y + p1 * x + p2 * y);
        let xx = g + 2.0 * (dg * x * x + p1 * y + 3.0 * p2 * x);
        let yy = g + 2.0 * (dg * y * y + 3.0 * p1 * y + p2 * x);
        let z = point.z;
        let by_point = Matrix2x3::new(
            xx / z,
            across / z,
            -(xx * x + across * y) / z,
            across / z,
            yy / z,
            -(across * x + yy * y) / z,
        );
        Some((seen, by_coefficients, by_point))
    }

    /// The same by Kannala–Brandt, also for rays beside and behind the camera.
    fn fisheye(
        &self,
        point: &Vector3<f64>,
    ) -> Option<(Vector2<f64>, SMatrix<f64, 2, 5>, Matrix2x3<f64>)> {
        let (r2, z) = (point.xy().norm_squared(), point.z);
        let rho2 = r2 + z * z;
        if r2 <= ON_AXIS * rho2 {
            if z <= 0.0 {
                return None;
            }
            let by_point = Matrix2x3::new(
                1.0 / z,
                0.0,
                -point.x / (z * z),
                0.0,
                1.0 / z,
                -point.y / (z * z),
            );
            return Some((point.xy() / z, SMatrix::zeros(), by_point));
        }
        let r = r2.sqrt();
        let theta = r.atan2(z);
        let t2 = theta * theta;
        let k = self.coefficients();
        let shown = theta * (1.0 + t2 * (k[0] + t2 * (k[1] + t2 * (k[2] + t2 * k[3]))));
        let slope =
            1.0 + t2 * (3.0 * k[0] + t2 * (5.0 * k[1] + t2 * (7.0 * k[2] + t2 * 9.0 * k[3])));
        let scale = shown / r;
        let mut by_coefficients = SMatrix::<f64, 2, 5>::zeros();
        let mut power = theta;
        for i in 0..4 {
            power *= t2;
            by_coefficients[(0, i)] = power * point.x / r;
            by_coefficients[(1, i)] = power * point.y / r;
        }
        // ∂ scale: by x and y through r and θ, by z through θ alone; ∂θ/∂r = z/ρ², ∂θ/∂z = −r/ρ².
        let by_r = (slope * z / rho2 - scale) / r;
        let by_z = -slope / rho2;
        let (x, y) = (point.x, point.y);
        let by_point = Matrix2x3::new(
            scale + x * by_r * x / r,
            x * by_r * y / r,
            x * by_z,
            y * by_r * x / r,
            scale + y * by_r * y / r,
            y * by_z,
        );
        Some((point.xy() * scale, by_coefficients, by_point))
    }

    /// The angle between the axis and the ray whose image is this far to the right of the principal point, in units of the focal length;
    /// `None` if there is none.
    fn angle(&self, right: f64) -> Option<f64> {
        match self.model {
            LensModel::BrownConrady => {
                let ideal = self.distortion()?.undistort(&Vector2::new(right, 0.0))?;
                Some(ideal.norm().atan())
            }
            LensModel::Fisheye => {
                let [k1, k2, k3, k4, ..] = self.numbers[4..] else {
                    return None;
                };
                let seen = right.abs();
                let shown = |t: f64| {
                    let t2 = t * t;
                    t * (1.0 + t2 * (k1 + t2 * (k2 + t2 * (k3 + t2 * k4))))
                };
                let steps = 720;
                let at = |i: usize| PI * i as f64 / steps as f64;
                let above = (1..=steps).find(|i| shown(at(*i)) >= seen)?;
                // Beyond the angle at which it folds over, the lens model is invalid.
                if (1..above).any(|i| shown(at(i)) < shown(at(i - 1))) {
                    return None;
                }
                let (mut low, mut high) = (at(above - 1), at(above));
                for _ in 0..50 {
                    let middle = 0.5 * (low + high);
                    if shown(middle) < seen {
                        low = middle;
                    } else {
                        high = middle;
                    }
                }
                Some(low)
            }
        }
    }

    /// Horizontal field of view of an image of this width, at the principal point's height, in degrees.
    pub(crate) fn hfov_deg(&self, width: u32) -> Option<f64> {
        let [fx, _, cx, ..] = self.numbers;
        let left = self.angle(-(cx + 0.5) / fx)?;
        let right = self.angle((f64::from(width) - 0.5 - cx) / fx)?;
        Some((left + right).to_degrees())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn camera(model: LensModel, k: &[f64]) -> Camera {
        let mut camera = Camera::without_distortion(model, [400.0, 390.0, 320.0, 240.0]);
        camera.numbers[4..model.numbers()].copy_from_slice(&k[..model.numbers() - 4]);
        camera
    }

    proptest! {
        /// All derivatives, compared with central differences. Their truncation error is h² times the third derivative, which is some 1e4
        /// pixels here: 1e-8. Rounding adds 1e-13 / h.
        #[test]
        fn derivatives_match_finite_differences(
            fisheye: bool, k in proptest::collection::vec(-0.1..0.1f64, 5),
            x in -0.6..0.6f64, y in -0.6..0.6f64, z in 0.7..1.5f64,
        ) {
            let model = if fisheye { LensModel::Fisheye } else { LensModel::BrownConrady };
            let camera = camera(model, &k);
            let point = Vector3::new(x, y, z);
            let at = camera.project(&point).unwrap();
            let h = 1e-6;
            for i in 0..3 {
                let mut step = Vector3::zeros();
                step[i] = h;
                let pixel = |p: Vector3<f64>| camera.project(&p).unwrap().pixel;
                let measured = (pixel(point + step) - pixel(point - step)) / (2.0 * h);
                prop_assert!((measured - at.by_point.column(i)).norm() < 1e-5, "{i} {measured} {}", at.by_point);
            }
            for i in 0..model.numbers() {
                let moved = |by: f64| {
                    let mut other = camera;
                    other.numbers[i] += by;
                    other.project(&point).unwrap().pixel
                };
                let measured = (moved(h) - moved(-h)) / (2.0 * h);
                prop_assert!((measured - at.by_camera.column(i)).norm() < 1e-5, "{i} {measured}");
            }
        }

        /// The lens is the same as that of `deepfusion-geometry`.
        #[test]
        fn the_lens_matches_the_geometry_crate(
            fisheye: bool, k in proptest::collection::vec(-0.1..0.1f64, 5), x in -0.6..0.6f64, y in -0.6..0.6f64,
        ) {
            let model = if fisheye { LensModel::Fisheye } else { LensModel::BrownConrady };
            let camera = camera(model, &k);
            let seen = camera.distortion().unwrap().distort(&Vector2::new(x, y));
            let pixel = camera.project(&Vector3::new(2.0 * x, 2.0 * y, 2.0)).unwrap().pixel;
            let expected = Vector2::new(400.0 * seen.x + 320.0, 390.0 * seen.y + 240.0);
            prop_assert!((pixel - expected).norm() < 1e-10);
        }
    }

    #[test]
    fn fields_of_view_are_exact() {
        let pinhole =
            Camera::without_distortion(LensModel::BrownConrady, [320.0, 320.0, 319.5, 239.5]);
        assert!((pinhole.hfov_deg(640).unwrap() - 90.0).abs() < 1e-9);
        // 320 px from the middle at 160 px per radian: 2 rad to each side.
        let wide = Camera::without_distortion(LensModel::Fisheye, [160.0, 160.0, 319.5, 239.5]);
        assert!((wide.hfov_deg(640).unwrap() - 4.0_f64.to_degrees()).abs() < 1e-6);
        // A fisheye sees points beside the camera, and a pinhole does not.
        let aside = Vector3::new(1.0, 0.0, -0.2);
        assert!(wide.project(&aside).is_some() && pinhole.project(&aside).is_none());
        let straight = wide.project(&Vector3::new(0.0, 0.0, 1.0)).unwrap();
        assert_eq!(straight.pixel, Vector2::new(319.5, 239.5));
    }
}
