//! Computes sparse ground-truth depth from a velodyne scan.

use crate::truth::GtKind;
use deepfusion_geometry::DepthMap;
use deepfusion_geometry::cloud::PointCloud;
use nalgebra::{Matrix3, Matrix3x4, Vector3, Vector4};

/// The scan as a sparse depth map of `width` × `height` pixels, metres, 0 = no depth.
///
/// `pixels_from_velo` is the 3×4 projection of a point (x forward, y left, z up, metres) to homogeneous
/// pixels. Points behind the sensor (x < 0) are left out, pixels are rounded with halves to even, and
/// the nearest point wins a pixel. With [`GtKind::Velodyne`], points in front of the sensor but behind the
/// camera (0 ≤ x < 0.3 m, none in practice) are projected too, as in the published files.
#[must_use]
pub fn depth_map(
    scan: &PointCloud,
    pixels_from_velo: &Matrix3x4<f64>,
    (width, height): (usize, usize),
    kind: GtKind,
) -> DepthMap {
    let shift = match kind {
        GtKind::Z | GtKind::Annotated => 0.0,
        GtKind::Velodyne => 1.0,
    };
    let mut map = DepthMap::empty(width, height);
    for &[x, y, z] in &scan.xyz {
        if x.is_nan() || x < 0.0 {
            continue;
        }
        let point = Vector4::new(f64::from(x), f64::from(y), f64::from(z), 1.0);
        let q = pixels_from_velo * point;
        let u = (q.x / q.z).round_ties_even() - shift;
        let v = (q.y / q.z).round_ties_even() - shift;
        let depth = match kind {
            GtKind::Z | GtKind::Annotated => q.z,
            GtKind::Velodyne => point.x,
        };
        if depth > 0.0 && u >= 0.0 && v >= 0.0 && u < width as f64 && v < height as f64 {
            map.set_nearest(u as usize, v as usize, depth as f32);
        }
    }
    map
}

/// The point (x forward, y left, z up, metres) that [`depth_map`] put at a pixel (column, row) with this
/// depth, up to rounding by half a pixel; `None` if the projection has no inverse.
#[must_use]
pub fn velo_point(
    pixels_from_velo: &Matrix3x4<f64>,
    (column, row): (usize, usize),
    depth_m: f64,
    kind: GtKind,
) -> Option<Vector3<f64>> {
    let [x, y, z, rest] = [0, 1, 2, 3].map(|i| column_of(pixels_from_velo, i));
    match kind {
        // q = d·(u, v, 1) is known: three equations for x, y, z.
        GtKind::Z | GtKind::Annotated => {
            let q: Vector3<f64> = Vector3::new(column as f64, row as f64, 1.0) * depth_m;
            let matrix: Matrix3<f64> = Matrix3::from_columns(&[x, y, z]);
            Some(matrix.try_inverse()? * (q - rest))
        }
        // x is known instead of camera z: three equations for y, z and the depth.
        GtKind::Velodyne => {
            let pixel: Vector3<f64> = Vector3::new(column as f64 + 1.0, row as f64 + 1.0, 1.0);
            let matrix: Matrix3<f64> = Matrix3::from_columns(&[y, z, -pixel]);
            let known: Vector3<f64> = rest + x * depth_m;
            let found: Vector3<f64> = matrix.try_inverse()? * -known;
            Some(Vector3::new(depth_m, found.x, found.y))
        }
    }
}

fn column_of(matrix: &Matrix3x4<f64>, i: usize) -> Vector3<f64> {
    Vector3::new(matrix[(0, i)], matrix[(1, i)], matrix[(2, i)])
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Both kinds of ground truth give back the original point, up to the rounding to pixels.
    #[test]
    fn a_pixel_gives_back_its_point() {
        // Camera axes from the velodyne's, 0.27 m behind the camera's plane, KITTI's focal length.
        let pixels_from_velo = Matrix3x4::new(
            609.56, -721.54, 0.0, -164.6, 172.85, 0.0, -721.54, -46.7, 1.0, 0.0, 0.0, -0.27,
        );
        let point = [17.3_f32, -2.4, -1.1];
        let scan = PointCloud {
            xyz: vec![point],
            ..PointCloud::default()
        };
        for kind in [GtKind::Z, GtKind::Velodyne] {
            let map = depth_map(&scan, &pixels_from_velo, (1242, 375), kind);
            let index = map.data.iter().position(|d| *d > 0.0).unwrap();
            let pixel = (index % 1242, index / 1242);
            let back = velo_point(&pixels_from_velo, pixel, map.data[index].into(), kind).unwrap();
            let off = back - Vector3::from(point.map(f64::from));
            // Half a pixel either way at 17 m: 17 · 0.5 · √2 / 721 = 1.7 cm.
            assert!(off.norm() < 0.017, "{kind:?}: {off}");
        }
    }
}
