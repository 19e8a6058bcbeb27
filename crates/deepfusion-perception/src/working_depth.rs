//! The size at which a depth image is processed.

use deepfusion_geometry::{DepthMap, Intrinsics};

use crate::Target;

/// Widest depth image that is processed: more pixels take time and add nothing to what the network predicted.
const WIDTH: usize = 640;

/// The depth at its working size, taken from the nearest pixel (a mean would create points between near and far surfaces), with its camera.
#[must_use]
pub fn working_depth(depth: &DepthMap, k: &Intrinsics) -> (DepthMap, Intrinsics) {
    if depth.width <= WIDTH {
        return (depth.clone(), *k);
    }
    let height = (depth.height * WIDTH).div_ceil(depth.width).max(1);
    let k = k.resized(WIDTH as u32, height as u32);
    (depth.nearest(WIDTH, height), k)
}

/// Converts [`Target::bounds`] from pixels of a depth image at its working size to those of another image, both sizes given as width and
/// height. The result is the whole pixels that contain them.
pub fn scale_bounds(targets: &mut [Target], working: [usize; 2], image: [u32; 2]) {
    for bounds in targets
        .iter_mut()
        .filter_map(|target| target.bounds.as_mut())
    {
        for (i, side) in bounds.iter_mut().enumerate() {
            let (from, to) = (working[i % 2].max(1) as u64, u64::from(image[i % 2]));
            let begin = |pixel: u64| pixel * to / from;
            let pixel = u64::from(*side);
            let scaled = match i {
                0 | 1 => begin(pixel),
                _ => ((pixel + 1) * to).div_ceil(from).saturating_sub(1),
            };
            *side = scaled.min(to.saturating_sub(1)) as u32;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn bounds_are_scaled_to_the_image() {
        let scaled = |bounds, working, image| {
            let mut targets = [Target {
                id: 1,
                center_m: [0.0, 0.0, 9.0],
                size_m: [4.0, 2.0, 1.5],
                yaw_rad: 0.0,
                distance_m: 9.0,
                sigma_m: None,
                velocity_mps: None,
                likely_velocity_mps: None,
                moving: None,
                confidence: 1.0,
                pixels: 0,
                class: None,
                bounds: Some(bounds),
                detection: None,
            }];
            scale_bounds(&mut targets, working, image);
            targets[0].bounds.unwrap()
        };
        assert_eq!(
            scaled([0, 0, 639, 193], [640, 194], [1242, 375]),
            [0, 0, 1241, 374]
        );
        assert_eq!(
            scaled([10, 20, 11, 20], [640, 194], [1280, 388]),
            [20, 40, 23, 41]
        );
        assert_eq!(scaled([3, 4, 5, 6], [64, 32], [64, 32]), [3, 4, 5, 6]);
    }

    #[test]
    fn the_working_size_keeps_pixels_where_the_camera_sees_them() {
        let (width, height) = (1242, 375);
        let k = Intrinsics {
            fx: 721.5,
            fy: 721.5,
            cx: 609.6,
            cy: 172.9,
            width: 1242,
            height: 375,
        };
        // Depth values that encode their column and row.
        let data = (0..width * height).map(|i| 1.0 + i as f32).collect();
        let depth = DepthMap {
            width,
            height,
            data,
        };
        let (small, small_k) = working_depth(&depth, &k);
        assert_eq!((small.width, small.height), (640, 194));
        for (u, v) in [(0, 0), (320, 97), (639, 193)] {
            let from = small.data[v * 640 + u] as usize - 1;
            let (x, y) = ((from % width) as f64, (from / width) as f64);
            let ray = (x - k.cx) / k.fx - (u as f64 - small_k.cx) / small_k.fx;
            assert!(ray.abs() < 1.0 / small_k.fx, "{u}: {ray}");
            let ray = (y - k.cy) / k.fy - (v as f64 - small_k.cy) / small_k.fy;
            assert!(ray.abs() < 1.0 / small_k.fy, "{v}: {ray}");
        }
        let tiny = DepthMap::empty(64, 32);
        assert_eq!(working_depth(&tiny, &k).0, tiny);
    }
}
