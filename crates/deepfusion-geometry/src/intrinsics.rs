use deepfusion_hint::Hint;
use nalgebra::{Matrix3, Vector2, Vector3};
use serde::{Deserialize, Serialize};

/// Horizontal fields of view from which a camera can be made, in degrees, limits excluded: beyond them no pinhole camera is usable, and a
/// wider lens needs its distortion.
pub const HFOV_DEG: (f64, f64) = (1.0, 170.0);

/// Why numbers are not a valid camera.
#[derive(Debug, Clone, Copy, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum ImplausibleCamera {
    /// A focal length is not positive, or not finite.
    #[error("{name} is {value}, expected a focal length above 0")]
    Focal {
        /// `fx` or `fy`.
        name: &'static str,
        /// Its value, in pixels.
        value: f64,
    },
    /// The principal point lies outside of the image.
    #[error("{name} is {value:.1}, outside an image of {size} pixels")]
    Centre {
        /// `cx` or `cy`.
        name: &'static str,
        /// The principal point's value, in pixels.
        value: f64,
        /// The image's size along this axis, in pixels.
        size: u32,
    },
}

impl Hint for ImplausibleCamera {
    fn hint(&self) -> Option<String> {
        Some("give fx, fy, cx, cy in pixels of this image".into())
    }
}

/// A pinhole camera without distortion, in pixels of its image.
///
/// The size of that image is part of the type, so that a matrix of one image size cannot silently
/// be used with an image of another.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Intrinsics {
    /// Focal length along x, in pixels.
    pub fx: f64,
    /// Focal length along y, in pixels.
    pub fy: f64,
    /// Principal point, x, in pixels (integer pixel centres).
    pub cx: f64,
    /// Principal point, y, in pixels (integer pixel centres).
    pub cy: f64,
    /// Width of the image, in pixels.
    pub width: u32,
    /// Height of the image, in pixels.
    pub height: u32,
}

impl Intrinsics {
    /// Makes a camera from fx, fy, cx, cy in pixels of an image of this width and height. They are not checked; see [`Self::implausible`].
    #[must_use]
    pub fn from_numbers([fx, fy, cx, cy]: [f64; 4], (width, height): (u32, u32)) -> Self {
        Self {
            fx,
            fy,
            cx,
            cy,
            width,
            height,
        }
    }

    /// Makes a camera with square pixels and the principal point in the middle of the image.
    #[must_use]
    pub fn centred(focal_px: f64, (width, height): (u32, u32)) -> Self {
        let middle = |side: u32| (f64::from(side) - 1.0) / 2.0;
        let numbers = [focal_px, focal_px, middle(width), middle(height)];
        Self::from_numbers(numbers, (width, height))
    }

    /// Makes a camera with square pixels, the principal point in the middle, and the field of view between the image's left and right edge:
    /// f = W/2 / tan(hfov/2), with `hfov_deg` in degrees. It is not checked; see [`HFOV_DEG`].
    #[must_use]
    pub fn from_hfov(hfov_deg: f64, size: (u32, u32)) -> Self {
        let half = (hfov_deg / 2.0).to_radians();
        Self::centred(f64::from(size.0) / 2.0 / half.tan(), size)
    }

    /// The camera for images of another size with the same field of view along their longer side, with pixels of the same shape and the
    /// principal point in the middle.
    #[must_use]
    pub fn centred_at(&self, (width, height): (u32, u32)) -> Self {
        let scale = f64::from(width.max(height)) / f64::from(self.width.max(self.height));
        Self {
            fy: self.fy * scale,
            ..Self::centred(self.fx * scale, (width, height))
        }
    }

    /// The same camera after its image was resized to `width` × `height` with half-pixel centres
    /// (OpenCV, PIL): f' = s·f, c' = s(c + ½) − ½ on each axis.
    #[must_use]
    pub fn resized(&self, width: u32, height: u32) -> Self {
        let sx = f64::from(width) / f64::from(self.width);
        let sy = f64::from(height) / f64::from(self.height);
        Self {
            fx: sx * self.fx,
            fy: sy * self.fy,
            cx: sx * (self.cx + 0.5) - 0.5,
            cy: sy * (self.cy + 0.5) - 0.5,
            width,
            height,
        }
    }

    /// The same camera after its image was cut to the `width` × `height` window at (`x`, `y`).
    #[must_use]
    pub fn cropped(&self, x: u32, y: u32, width: u32, height: u32) -> Self {
        Self {
            cx: self.cx - f64::from(x),
            cy: self.cy - f64::from(y),
            width,
            height,
            ..*self
        }
    }

    /// The same camera after its image was mirrored left to right: c_x' = W − 1 − c_x.
    #[must_use]
    pub fn flipped(&self) -> Self {
        Self {
            cx: f64::from(self.width) - 1.0 - self.cx,
            ..*self
        }
    }

    /// The 3×3 matrix K.
    #[must_use]
    pub fn matrix(&self) -> Matrix3<f64> {
        Matrix3::new(self.fx, 0.0, self.cx, 0.0, self.fy, self.cy, 0.0, 0.0, 1.0)
    }

    /// K⁻¹, in closed form.
    #[must_use]
    pub fn inverse_matrix(&self) -> Matrix3<f64> {
        Matrix3::new(
            1.0 / self.fx,
            0.0,
            -self.cx / self.fx,
            0.0,
            1.0 / self.fy,
            -self.cy / self.fy,
            0.0,
            0.0,
            1.0,
        )
    }

    /// Pixel of a point in the camera frame; `None` on or behind the image plane (z ≤ 1e-3 m).
    #[must_use]
    pub fn project(&self, point_in_cam: &Vector3<f64>) -> Option<Vector2<f64>> {
        (point_in_cam.z > 1e-3).then(|| {
            Vector2::new(
                self.fx * point_in_cam.x / point_in_cam.z + self.cx,
                self.fy * point_in_cam.y / point_in_cam.z + self.cy,
            )
        })
    }

    /// The point at camera z = `depth_m` seen at pixel (`u`, `v`), in the camera frame (paper Eq. 3).
    #[must_use]
    pub fn back_project(&self, u: f64, v: f64, depth_m: f64) -> Vector3<f64> {
        Vector3::new(
            (u - self.cx) / self.fx * depth_m,
            (v - self.cy) / self.fy * depth_m,
            depth_m,
        )
    }

    /// Why these numbers are not a valid camera, or `None` if they are: focal lengths that are not
    /// positive and finite, or a principal point outside the image.
    #[must_use]
    pub fn implausible(&self) -> Option<ImplausibleCamera> {
        for (name, value) in [("fx", self.fx), ("fy", self.fy)] {
            if !(value.is_finite() && value > 0.0) {
                return Some(ImplausibleCamera::Focal { name, value });
            }
        }
        for (name, value, size) in [("cx", self.cx, self.width), ("cy", self.cy, self.height)] {
            if !(value >= 0.0 && value < f64::from(size)) {
                return Some(ImplausibleCamera::Centre { name, value, size });
            }
        }
        None
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use approx::assert_relative_eq;
    use proptest::prelude::*;

    fn kitti() -> Intrinsics {
        Intrinsics {
            fx: 721.5377,
            fy: 721.5377,
            cx: 609.5593,
            cy: 172.854,
            width: 1242,
            height: 375,
        }
    }

    #[test]
    fn k_times_its_inverse_is_identity() {
        assert_relative_eq!(
            kitti().matrix() * kitti().inverse_matrix(),
            Matrix3::identity(),
            epsilon = 1e-12
        );
    }

    #[test]
    fn a_point_behind_the_camera_has_no_pixel() {
        assert!(kitti().project(&Vector3::new(0.0, 0.0, -1.0)).is_none());
        assert!(kitti().project(&Vector3::new(0.0, 0.0, 1e-4)).is_none());
    }

    #[test]
    fn a_field_of_view_is_a_focal_length() {
        let k = Intrinsics::from_hfov(90.0, (1280, 720));
        assert_relative_eq!(k.fx, 640.0, epsilon = 1e-9);
        assert_eq!((k.fx, k.cx, k.cy), (k.fy, 639.5, 359.5));
        // The image's edges lie half a pixel outside the outermost centres.
        let edge = k.back_project(-0.5, k.cy, 1.0);
        assert_relative_eq!(edge.x, -1.0, epsilon = 1e-12);
    }

    #[test]
    fn implausible_cameras_are_named() {
        assert_eq!(kitti().implausible(), None);
        let wrong = Intrinsics { fx: 0.0, ..kitti() };
        let (name, value) = ("fx", 0.0);
        let focal = ImplausibleCamera::Focal { name, value };
        assert_eq!(wrong.implausible(), Some(focal));
        assert_eq!(
            focal.to_string(),
            "fx is 0, expected a focal length above 0"
        );
        let wrong = Intrinsics {
            cy: 400.0,
            ..kitti()
        };
        let text = wrong.implausible().unwrap().to_string();
        assert_eq!(text, "cy is 400.0, outside an image of 375 pixels");
    }

    proptest! {
        /// In a resized image, a point appears at the pixel to which resizing moves its old pixel.
        #[test]
        fn resize_moves_the_projection_with_the_pixels(
            x in -20.0..20.0f64, y in -3.0..3.0f64, z in 1.0..80.0f64, w in 32u32..2000, h in 32u32..2000,
        ) {
            let k = kitti();
            let p = Vector3::new(x, y, z);
            let before = k.project(&p).unwrap();
            let after = k.resized(w, h).project(&p).unwrap();
            let s = f64::from(w) / 1242.0;
            prop_assert!((after.x - (s * (before.x + 0.5) - 0.5)).abs() < 1e-8);
        }

        /// Mirroring the world and the camera together mirrors the pixel.
        #[test]
        fn flip_mirrors_the_projection(x in -20.0..20.0f64, y in -3.0..3.0f64, z in 1.0..80.0f64) {
            let k = kitti();
            let before = k.project(&Vector3::new(x, y, z)).unwrap();
            let after = k.flipped().project(&Vector3::new(-x, y, z)).unwrap();
            prop_assert!((after.x - (1241.0 - before.x)).abs() < 1e-9);
            prop_assert!((after.y - before.y).abs() < 1e-12);
        }

        #[test]
        fn crop_shifts_the_projection(x in -2.0..2.0f64, z in 5.0..80.0f64, dx in 0u32..500, dy in 0u32..100) {
            let k = kitti();
            let p = Vector3::new(x, 0.5, z);
            let before = k.project(&p).unwrap();
            let after = k.cropped(dx, dy, 640, 192).project(&p).unwrap();
            prop_assert!((after.x + f64::from(dx) - before.x).abs() < 1e-9);
            prop_assert!((after.y + f64::from(dy) - before.y).abs() < 1e-9);
        }

        #[test]
        fn back_projection_inverts_projection(u in 0.0..1241.0f64, v in 0.0..374.0f64, z in 0.1..90.0f64) {
            let k = kitti();
            let pixel = k.project(&k.back_project(u, v, z)).unwrap();
            prop_assert!((pixel.x - u).abs() < 1e-8 && (pixel.y - v).abs() < 1e-8);
        }
    }
}
