//! Taking a lens' distortion out of images.

use crate::{Error, NoLens, Result};
use deepfusion_geometry::{DepthMap, Distortion, Intrinsics};
use image::{Rgb, RgbImage};
use std::sync::Arc;

/// Turns a camera's images into those of a pinhole camera, of the same size and without invalid pixels.
///
/// The pinhole camera is the one that sees the largest upright rectangle whose every ray is in the image,
/// stretched to the image's size, as OpenCV's `getOptimalNewCameraMatrix` with `alpha = 0` does (fx and fy
/// may then differ). Nothing black can appear at a border, where training would take it for the world. Of a fisheye lens that sees
/// more, only what lies within 60 degrees of the axis to each side is kept: towards 90 degrees a pinhole camera's image has no end.
#[derive(Debug, Clone)]
pub struct Lens {
    /// Of the image after correction.
    pinhole: Intrinsics,
    /// For each pixel of the corrected image, where it lies in the original one; `None` without
    /// distortion.
    map: Option<Arc<Vec<[f32; 2]>>>,
}

impl Lens {
    /// The correction of a camera with `distortion`, whose matrix `camera` is that of the images as they
    /// are.
    ///
    /// # Errors
    /// [`NoLens`], where the coefficients fold the image's border over: they belong to another camera, or
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
                // Between the border's sampled rays the rectangle may reach out by a fraction of a pixel.
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

    /// Whether there is anything to correct.
    #[must_use]
    pub fn distorts(&self) -> bool {
        self.map.is_some()
    }

    /// The corrected image, bilinear between pixels.
    ///
    /// # Errors
    /// [`Error::Size`] for an image of another size than the camera's.
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

    /// The corrected depth map (camera z, which a lens does not change), each pixel from its nearest: a
    /// mean over an edge would be a depth that is nowhere. A map of the images' shape in another size, as of a phone's depth sensor, is taken
    /// for what the whole image shows.
    ///
    /// # Errors
    /// [`Error::Size`] for a map of another shape than the camera's images.
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

/// Whether a depth map has an image's aspect ratio, as nearly as whole pixels of it can. One that has the image's width or height
/// alone was cut, and shows another part.
fn same_shape(depth: &DepthMap, width: usize, height: usize) -> bool {
    let whole = depth.width > 0 && depth.height > 0;
    if !whole || (depth.width == width) != (depth.height == height) {
        return false;
    }
    let (across, down) = ((depth.width * height) as f64, (depth.height * width) as f64);
    let off = (across - down).abs();
    off < width as f64 && off < height as f64
}

/// The map in another size, each pixel the depth of the one in which its centre lies.
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

/// How far to each side a pinhole image of a fisheye lens reaches at most: tan 60°.
const WIDEST: f64 = 1.732_050_807_568_877_2;

/// The pinhole camera of the largest rectangle of rays that are all in the image.
fn largest_valid(
    camera: &Intrinsics,
    distortion: &Distortion,
) -> std::result::Result<Intrinsics, NoLens> {
    let (right, bottom) = (f64::from(camera.width - 1), f64::from(camera.height - 1));
    // Calibrations often fold over in the corners, where no board was seen: such pixels have no ray, and
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
        // A border without a ray is 90 degrees from the axis or more, where the widest image ends long before.
        let limit = |side: Option<f64>, widest: f64| {
            let side = side.unwrap_or(widest);
            Some(if side.abs() > WIDEST { widest } else { side })
        };
        [
            limit(left_x, -WIDEST),
            limit(top_y, -WIDEST),
            limit(right_x, WIDEST),
            limit(bottom_y, WIDEST),
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
    // Its corners are its farthest rays. They must be what the lens shows where it shows them.
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
        // x(1 - 2x²) is 0.27 at most; the image's sides are at 0.48 and more.
        let fold = Distortion::from_opencv(&[-2.0, 0.0, 0.0, 0.0]).unwrap();
        assert_eq!(Lens::new(camera(), &fold).unwrap_err(), NoLens::FoldsOver);
    }

    #[test]
    fn corners_that_fold_over_are_left_out() {
        // x(1 - x²/4) turns back at 0.77; the image's corners are at 0.84.
        let bent = Distortion::from_opencv(&[-0.25, 0.0, 0.0, 0.0]).unwrap();
        let k = Lens::new(camera(), &bent).unwrap().intrinsics();
        assert!(k.fx < 60.0 && k.fx > 40.0, "{k:?}");
    }

    #[test]
    fn another_size_is_refused() {
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

    /// A map of half the size, and one of three quarters, whose pixels are no whole number of the image's.
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
        // A larger map is thinned out.
        let twice = straight.correct_depth(map(160, 120)).unwrap();
        assert_eq!(twice.data[..3], [161.0, 163.0, 165.0]);
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(40))]
        /// A point in the world is at one place before and after: where the corrected camera's pinhole
        /// sees it, the map points to where the lens shows it. And no pixel looks beyond the image.
        #[test]
        fn corrected_pixels_see_their_rays(
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
                // Clamping moves a pixel by 1e-3 at most, single precision by 1e-5.
                prop_assert!((a - f64::from(b)).abs() < 1e-3, "{pixel:?} {mapped:?}");
                prop_assert!(a > -1e-3 && a < size - 1.0 + 1e-3);
            }
        }
    }
}
