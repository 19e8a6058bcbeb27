//! Corrects a lens' distortion in images.

use crate::{Error, NoLens, Result};
use deepfusion_geometry::{DepthMap, Distortion, Intrinsics};
use image::{Rgb, RgbImage};
use std::sync::Arc;

/// Turns a camera's images into those of a pinhole camera, of the same size and without invalid pixels.
///
/// The pinhole camera sees the largest upright rectangle whose rays are all in the image, stretched to the
/// image's size, like OpenCV's `getOptimalNewCameraMatrix` with `alpha = 0` (fx and fy may then differ).
/// So no black pixels appear at the borders, which training would take for a part of the scene. For a fisheye lens,
/// at most 60 degrees to each side of the axis are kept: a pinhole camera's image grows without bound towards 90 degrees.
#[derive(Debug, Clone)]
pub struct Lens {
    /// Intrinsics of the corrected image.
    pinhole: Intrinsics,
    /// For each pixel of the corrected image, its position in the original one; `None` without
    /// distortion.
    map: Option<Arc<Vec<[f32; 2]>>>,
}

impl Lens {
    /// The correction for a camera with `distortion` and the intrinsics `camera` of the original images.
    ///
    /// # Errors
    /// [`NoLens`] if the coefficients fold the image's border over: they belong to another camera, or
    /// to images of another size.
    pub fn new(camera: Intrinsics, distortion: &Distortion) -> std::result::Result<Self, NoLens> {
        if distortion.is_none() {
            return Ok(Self {
                pinhole: camera,
                map: None,
            });
        }
        let pinhole = largest_valid(&camera, distortion)?;
        let (right, bottom) = (camera.width - 1, camera.height - 1);
        let mut map = Vec::with_capacity(camera.width as usize * camera.height as usize);
        for v in 0..camera.height {
            for u in 0..camera.width {
                let ideal = pinhole.back_project(f64::from(u), f64::from(v), 1.0).xy();
                let seen = distortion.distort(&ideal);
                // Between the rays sampled along the border, the rectangle may exceed the image by a fraction of a pixel.
                map.push([
                    (camera.fx * seen.x + camera.cx).clamp(0.0, f64::from(right)) as f32,
                    (camera.fy * seen.y + camera.cy).clamp(0.0, f64::from(bottom)) as f32,
                ]);
            }
        }
        Ok(Self {
            pinhole,
            map: Some(Arc::new(map)),
        })
    }

    /// The camera of the corrected images.
    #[must_use]
    pub fn intrinsics(&self) -> Intrinsics {
        self.pinhole
    }

    /// Whether the camera has a distortion to correct.
    #[must_use]
    pub fn distorts(&self) -> bool {
        self.map.is_some()
    }

    /// The corrected image, with bilinear interpolation.
    ///
    /// # Errors
    /// [`Error::Size`] if the image's size differs from the camera's.
    pub fn correct(&self, image: RgbImage) -> Result<RgbImage> {
        let (width, height) = (self.pinhole.width, self.pinhole.height);
        let Some(map) = &self.map else {
            return Ok(image);
        };
        if image.dimensions() != (width, height) {
            return Err(Error::Size {
                what: "the lens' correction",
                found: (width, height),
                image: image.dimensions(),
            });
        }
        let mut corrected = RgbImage::new(width, height);
        for (pixel, [x, y]) in corrected.pixels_mut().zip(map.iter()) {
            let (x0, y0) = (x.floor(), y.floor());
            let (fx, fy) = (x - x0, y - y0);
            let (x0, y0) = (x0 as u32, y0 as u32);
            let (x1, y1) = ((x0 + 1).min(width - 1), (y0 + 1).min(height - 1));
            let corners = [(x0, y0), (x1, y0), (x0, y1), (x1, y1)].map(|(x, y)| image[(x, y)].0);
            let weights = [
                (1.0 - fx) * (1.0 - fy),
                fx * (1.0 - fy),
                (1.0 - fx) * fy,
                fx * fy,
            ];
            *pixel = Rgb([0, 1, 2].map(|c| {
                let sum: f32 = (0..4).map(|i| weights[i] * f32::from(corners[i][c])).sum();
                (sum + 0.5) as u8
            }));
        }
        Ok(corrected)
    }

    /// The corrected depth map (camera z, which a lens does not change), with nearest-neighbour interpolation: a
    /// mean across an edge would be a depth that does not exist. A map with the images' aspect ratio but another size, such as a phone
    /// depth sensor's, is assumed to cover the whole image.
    ///
    /// # Errors
    /// [`Error::Size`] if the map's aspect ratio differs from that of the camera's images.
    pub fn correct_depth(&self, depth: DepthMap) -> Result<DepthMap> {
        let (width, height) = (self.pinhole.width as usize, self.pinhole.height as usize);
        let depth = if same_shape(&depth, width, height) {
            resized(depth, width, height)
        } else {
            return Err(Error::Size {
                what: "the depth image",
                found: (depth.width as u32, depth.height as u32),
                image: (width as u32, height as u32),
            });
        };
        let Some(map) = &self.map else {
            return Ok(depth);
        };
        let nearest =
            |[x, y]: &[f32; 2]| depth.data[y.round() as usize * width + x.round() as usize];
        Ok(DepthMap {
            width,
            height,
            data: map.iter().map(nearest).collect(),
        })
    }
}

/// Whether a depth map has an image's aspect ratio, up to rounding to whole pixels. A map with only the image's width or only its height
/// was cropped, and shows a part of the image.
fn same_shape(depth: &DepthMap, width: usize, height: usize) -> bool {
    let whole = depth.width > 0 && depth.height > 0;
    if !whole || (depth.width == width) != (depth.height == height) {
        return false;
    }
    let (across, down) = ((depth.width * height) as f64, (depth.height * width) as f64);
    let off = (across - down).abs();
    off < width as f64 && off < height as f64
}

/// The map in another size; each pixel has the depth of the old pixel that contains its centre.
fn resized(depth: DepthMap, width: usize, height: usize) -> DepthMap {
    if (depth.width, depth.height) == (width, height) {
        return depth;
    }
    let from = |i: usize, to: usize, of: usize| (2 * i + 1) * of / (2 * to);
    let columns: Vec<usize> = (0..width).map(|x| from(x, width, depth.width)).collect();
    let row = |y: usize| &depth.data[from(y, height, depth.height) * depth.width..][..depth.width];
    let data = (0..height).flat_map(|y| columns.iter().map(move |x| row(y)[*x]));
    DepthMap {
        width,
        height,
        data: data.collect(),
    }
}

/// Largest extent to each side of a pinhole image from a fisheye lens: tan 60°.
const MAX_TAN: f64 = 1.732_050_807_568_877_2;

/// The pinhole camera that sees the largest rectangle of rays that are all in the image.
fn largest_valid(
    camera: &Intrinsics,
    distortion: &Distortion,
) -> std::result::Result<Intrinsics, NoLens> {
    let (right, bottom) = (f64::from(camera.width - 1), f64::from(camera.height - 1));
    // Calibrations often fold over in the corners, where the board was never seen. Such pixels have no ray, and
    // the rectangle does not need them.
    let ray = |u: f64, v: f64| distortion.undistort(&camera.back_project(u, v, 1.0).xy());
    let rows = || (0..camera.height).map(f64::from);
    let columns = || (0..camera.width).map(f64::from);
    let left_x = rows().filter_map(|v| ray(0.0, v)).map(|p| p.x);
    let right_x = rows().filter_map(|v| ray(right, v)).map(|p| p.x);
    let top_y = columns().filter_map(|u| ray(u, 0.0)).map(|p| p.y);
    let bottom_y = columns().filter_map(|u| ray(u, bottom)).map(|p| p.y);
    let [left_x, top_y] = [left_x.reduce(f64::max), top_y.reduce(f64::max)];
    let [right_x, bottom_y] = [right_x.reduce(f64::min), bottom_y.reduce(f64::min)];
    let [left_x, top_y, right_x, bottom_y] = if distortion.fisheye.is_some() {
        // A border pixel without a ray is at least 90 degrees from the axis, far outside the widest image.
        let limit = |side: Option<f64>, widest: f64| {
            let side = side.unwrap_or(widest);
            Some(if side.abs() > MAX_TAN { widest } else { side })
        };
        [
            limit(left_x, -MAX_TAN),
            limit(top_y, -MAX_TAN),
            limit(right_x, MAX_TAN),
            limit(bottom_y, MAX_TAN),
        ]
    } else {
        [left_x, top_y, right_x, bottom_y]
    };
    let (Some(left_x), Some(right_x), Some(top_y), Some(bottom_y)) =
        (left_x, right_x, top_y, bottom_y)
    else {
        return Err(NoLens::FoldsOver);
    };
    let (fx, fy) = (right / (right_x - left_x), bottom / (bottom_y - top_y));
    let pinhole = Intrinsics {
        fx,
        fy,
        cx: -left_x * fx,
        cy: -top_y * fy,
        ..*camera
    };
    if let Some(why) = pinhole.implausible() {
        return Err(NoLens::Implausible(why));
    }
    // The corners are the rectangle's outermost rays. Distorting and undistorting them must give them back.
    for (u, v) in [(0.0, 0.0), (right, 0.0), (0.0, bottom), (right, bottom)] {
        let corner = pinhole.back_project(u, v, 1.0).xy();
        let back = distortion.undistort(&distortion.distort(&corner));
        if back.is_none_or(|back| (back - corner).norm() > 1e-6) {
            return Err(NoLens::FoldsOver);
        }
    }
    Ok(pinhole)
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn camera() -> Intrinsics {
        Intrinsics {
            fx: 60.0,
            fy: 58.0,
            cx: 41.0,
            cy: 28.0,
            width: 80,
            height: 60,
        }
    }

    #[test]
    fn without_distortion_nothing_changes() {
        let lens = Lens::new(camera(), &Distortion::default()).unwrap();
        assert!(!lens.distorts());
        assert_eq!(lens.intrinsics(), camera());
        let image = RgbImage::from_fn(80, 60, |x, y| Rgb([x as u8, y as u8, 7]));
        assert_eq!(lens.correct(image.clone()).unwrap(), image);
    }

    #[test]
    fn coefficients_of_another_camera_are_refused() {
        // x(1 - 2x²) is at most 0.27; the image's sides are at 0.48 and more.
        let fold = Distortion::from_opencv(&[-2.0, 0.0, 0.0, 0.0]).unwrap();
        assert_eq!(Lens::new(camera(), &fold).unwrap_err(), NoLens::FoldsOver);
    }

    #[test]
    fn corners_that_fold_over_are_left_out() {
        // x(1 - x²/4) is at most 0.77; the image's corners are at 0.84.
        let bent = Distortion::from_opencv(&[-0.25, 0.0, 0.0, 0.0]).unwrap();
        let k = Lens::new(camera(), &bent).unwrap().intrinsics();
        assert!(k.fx < 60.0 && k.fx > 40.0, "{k:?}");
    }

    #[test]
    fn images_of_another_size_are_refused() {
        let bent = Distortion::from_opencv(&[-0.2, 0.0, 0.0, 0.0]).unwrap();
        let lens = Lens::new(camera(), &bent).unwrap();
        assert!(lens.correct(RgbImage::new(79, 60)).is_err());
        assert!(lens.correct_depth(DepthMap::empty(80, 61)).is_err());
        for (width, height) in [(0, 60), (40, 60), (80, 59), (41, 30)] {
            let other = DepthMap::empty(width, height);
            assert!(lens.correct_depth(other).is_err(), "{width}x{height}");
        }
        for (width, height) in [(40, 30), (53, 40), (27, 20), (8, 6)] {
            let same = DepthMap::empty(width, height);
            assert!(lens.correct_depth(same).is_ok(), "{width}x{height}");
        }
    }

    /// A map of half the image's size, and one of three quarters, whose pixels do not align with the image's.
    #[test]
    fn a_depth_map_of_the_same_shape_is_enlarged() {
        let straight = Lens::new(camera(), &Distortion::from_opencv(&[0.0; 4]).unwrap()).unwrap();
        let map = |width: usize, height: usize| DepthMap {
            width,
            height,
            data: (0..width * height).map(|i| i as f32).collect(),
        };
        let half = straight.correct_depth(map(40, 30)).unwrap();
        assert_eq!((half.width, half.height), (80, 60));
        for (i, depth) in half.data.iter().enumerate() {
            assert_eq!(*depth, (i / 80 / 2 * 40 + i % 80 / 2) as f32);
        }
        let most = straight.correct_depth(map(60, 45)).unwrap();
        // Centres at 0.375, 1.125, 1.875, 2.625 of the map's pixels.
        assert_eq!(most.data[..8], [0.0, 1.0, 1.0, 2.0, 3.0, 4.0, 4.0, 5.0]);
        assert_eq!(most.data[80 * 59], 44.0 * 60.0);
        // A larger map is subsampled.
        let twice = straight.correct_depth(map(160, 120)).unwrap();
        assert_eq!(twice.data[..3], [161.0, 163.0, 165.0]);
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(40))]
        /// The map takes a point's pixel in the corrected pinhole image to its pixel in the original image, and
        /// never points outside the original image.
        #[test]
        fn corrected_pixels_map_to_their_rays_in_the_original(
            k1 in -0.2..0.3f64, k2 in -0.02..0.05f64, p1 in -0.003..0.003f64, p2 in -0.003..0.003f64,
            u in 0u32..80, v in 0u32..60,
        ) {
            let bent = Distortion::from_opencv(&[k1, k2, p1, p2]).unwrap();
            let lens = Lens::new(camera(), &bent).unwrap();
            let ray = lens.intrinsics().back_project(f64::from(u), f64::from(v), 1.0);
            let seen = bent.distort(&ray.xy());
            let pixel = [60.0 * seen.x + 41.0, 58.0 * seen.y + 28.0];
            let mapped = lens.map.as_ref().unwrap()[(v * 80 + u) as usize];
            for (a, (b, size)) in pixel.into_iter().zip(mapped.into_iter().zip([80.0, 60.0])) {
                // Clamping moves a pixel by at most 1e-3, single precision by 1e-5.
                prop_assert!((a - f64::from(b)).abs() < 1e-3, "{pixel:?} {mapped:?}");
                prop_assert!(a > -1e-3 && a < size - 1.0 + 1e-3);
            }
        }
    }
}
