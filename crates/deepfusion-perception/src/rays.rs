use deepfusion_geometry::Intrinsics;

/// Viewing rays of each column and each row: the point at depth z of pixel (u, v) is z·(x\[u\], y\[v\], 1) in
/// the camera's frame.
#[derive(Debug, Clone, PartialEq)]
pub struct Rays {
    /// (u − c_x) / f_x of each column.
    pub x: Vec<f32>,
    /// (v − c_y) / f_y of each row.
    pub y: Vec<f32>,
    /// Angle between two columns and between two rows at the image's middle, radians.
    pub step: [f32; 2],
}

impl Rays {
    /// The rays of a camera.
    #[must_use]
    pub fn of(k: &Intrinsics) -> Self {
        Self {
            x: (0..k.width)
                .map(|u| ((f64::from(u) - k.cx) / k.fx) as f32)
                .collect(),
            y: (0..k.height)
                .map(|v| ((f64::from(v) - k.cy) / k.fy) as f32)
                .collect(),
            step: [(1.0 / k.fx) as f32, (1.0 / k.fy) as f32],
        }
    }

    /// The point of a pixel at a depth, in the camera's frame, metres.
    #[must_use]
    pub fn point(&self, u: usize, v: usize, depth_m: f32) -> [f32; 3] {
        [self.x[u] * depth_m, self.y[v] * depth_m, depth_m]
    }
}
