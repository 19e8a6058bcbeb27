//! The size at which a depth image is looked at.

use deepfusion_geometry::{DepthMap, Intrinsics};

/// Widest depth image that is looked at: more pixels cost time and say no more than the network knew.
const WIDTH: usize = 640;

/// The depth at its working size, the nearest pixel of each (a mean would put points between near and far), with its
/// camera.
#[must_use]
pub fn working_depth(depth: &DepthMap, k: &Intrinsics) -> (DepthMap, Intrinsics) {
    if depth.width <= WIDTH {
        return (depth.clone(), *k);
    }
    let height = (depth.height * WIDTH).div_ceil(depth.width).max(1);
    let k = k.resized(WIDTH as u32, height as u32);
    (depth.nearest(WIDTH, height), k)
}

#[cfg(test)]
mod tests {
    use super::*;

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
        // Depth that tells its own column and row.
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
