//! Sparse ground-truth depth from a velodyne scan (SPEC 5).

use deepfusion_cloud::PointCloud;
use deepfusion_geometry::DepthMap;
use nalgebra::{Matrix3x4, Vector4};

/// What a ground-truth depth means and at which pixel it lies.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum GtKind {
    /// Camera z at pixel round(u), round(v), as in KITTI's annotated depth.
    #[default]
    Z,
    /// The sensor's forward distance at pixel round(u) − 1, round(v) − 1: the field's `eigen` files,
    /// whose convention dates from a MATLAB devkit that counts pixels from 1. For published numbers.
    Velodyne,
}

impl GtKind {
    /// The name on the command line and in reports.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Z => "z",
            Self::Velodyne => "velodyne",
        }
    }
}

impl std::str::FromStr for GtKind {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        match text {
            "z" => Ok(Self::Z),
            "velodyne" => Ok(Self::Velodyne),
            _ => Err(format!("'{text}' is no ground-truth depth: z or velodyne")),
        }
    }
}

/// The scan as a sparse depth map of `width` × `height` pixels, metres, 0 = none.
///
/// `pixels_from_velo` is the 3×4 projection of a point (x forward, y left, z up, metres) to homogeneous
/// pixels. Points behind the sensor (x < 0) are left out, pixels are rounded with halves to even, and
/// the nearest point wins a pixel. With [`GtKind::Velodyne`] points before the sensor yet behind the
/// camera (0 ≤ x < 0.3 m, none in practice) are projected too, as the field's files have it.
#[must_use]
pub fn depth_map(
    scan: &PointCloud,
    pixels_from_velo: &Matrix3x4<f64>,
    (width, height): (usize, usize),
    kind: GtKind,
) -> DepthMap {
    let shift = match kind {
        GtKind::Z => 0.0,
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
            GtKind::Z => q.z,
            GtKind::Velodyne => point.x,
        };
        if depth > 0.0 && u >= 0.0 && v >= 0.0 && u < width as f64 && v < height as f64 {
            map.set_nearest(u as usize, v as usize, depth as f32);
        }
    }
    map
}
