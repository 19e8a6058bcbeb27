use super::{Result, SizeProblem};
use crate::{DepthMap, Intrinsics};

/// Points and their attributes, column by column. Every column that is present has one entry per point.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct PointCloud {
    /// Position, in metres.
    pub xyz: Vec<[f32; 3]>,
    /// Colour, 8-bit RGB.
    pub rgb: Option<Vec<[u8; 3]>>,
    /// Strength of the return, in the sensor's own unit (KITTI: 0 to 1).
    pub intensity: Option<Vec<f32>>,
    /// Speed away from the sensor, in m/s; negative if the point approaches.
    pub radial_velocity: Option<Vec<f32>>,
    /// Confidence of the position, 0 to 1.
    pub confidence: Option<Vec<f32>>,
    /// Standard deviation of the depth that the point was made from, in metres along the camera's axis.
    pub sigma: Option<Vec<f32>>,
}

impl PointCloud {
    /// One point for every pixel that has a depth of at most `max_depth_m`, row by row, in the
    /// camera's frame (x right, y down, z forward; paper Eq. 3).
    ///
    /// `rgb` is the image of the same size, H×W×3 bytes.
    ///
    /// # Errors
    /// [`Error::Size`](super::Error::Size) if the camera's or the image's size differs from the depth map's.
    pub fn from_depth(
        depth: &DepthMap,
        k: &Intrinsics,
        rgb: Option<&[u8]>,
        max_depth_m: f32,
    ) -> Result<Self> {
        check_sizes(depth.data.len(), (depth.width, depth.height), k, rgb)?;
        Ok(back_project(&depth.data, k, rgb, max_depth_m, |depth| {
            depth
        }))
    }

    /// As [`Self::from_depth`], from metric disparity (1/m) of the camera's size, row by row, in one pass over the pixels. Disparities that
    /// are not positive give no point.
    ///
    /// # Errors
    /// [`Error::Size`](super::Error::Size) if the disparity's or the image's size differs from the camera's.
    pub fn from_disparity(
        disparity: &[f32],
        k: &Intrinsics,
        rgb: Option<&[u8]>,
        max_depth_m: f32,
    ) -> Result<Self> {
        let size = (k.width as usize, k.height as usize);
        check_sizes(disparity.len(), size, k, rgb)?;
        Ok(back_project(disparity, k, rgb, max_depth_m, |disparity| {
            1.0 / disparity
        }))
    }

    /// A column for the cloud that [`Self::from_depth`] makes of a depth map: the values at the pixels that become points. `values`
    /// contains one value per pixel of `depth`, row by row.
    #[must_use]
    pub fn column(values: &[f32], depth: &DepthMap, max_depth_m: f32) -> Vec<f32> {
        let pixels = depth.data.iter().zip(values);
        let kept = pixels.filter(|(z, _)| is_point(**z, max_depth_m));
        kept.map(|(_, value)| *value).collect()
    }

    /// Number of points.
    #[must_use]
    pub fn len(&self) -> usize {
        self.xyz.len()
    }

    /// Whether the cloud has no points.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.xyz.is_empty()
    }

    /// Checks that every column present has one entry per point.
    ///
    /// # Errors
    /// [`Error::Size`](super::Error::Size), naming the column.
    pub fn check(&self) -> Result<()> {
        let columns = [
            ("rgb", self.rgb.as_ref().map(Vec::len)),
            ("intensity", self.intensity.as_ref().map(Vec::len)),
            (
                "radial_velocity",
                self.radial_velocity.as_ref().map(Vec::len),
            ),
            ("confidence", self.confidence.as_ref().map(Vec::len)),
            ("sigma", self.sigma.as_ref().map(Vec::len)),
        ];
        let points = self.len();
        for (column, entries) in columns {
            if let Some(entries) = entries.filter(|entries| *entries != points) {
                let problem = SizeProblem::Column {
                    column,
                    entries,
                    points,
                };
                return Err(problem.into());
            }
        }
        Ok(())
    }
}

fn check_sizes(
    values: usize,
    (width, height): (usize, usize),
    k: &Intrinsics,
    rgb: Option<&[u8]>,
) -> Result<()> {
    let map = (width, height);
    if (k.width as usize, k.height as usize) != map {
        let camera = (k.width, k.height);
        return Err(SizeProblem::Camera { camera, map }.into());
    }
    if values != width * height {
        return Err(SizeProblem::Values { values, map }.into());
    }
    if let Some(bytes) = rgb
        && bytes.len() != width * height * 3
    {
        let bytes = bytes.len();
        return Err(SizeProblem::Colours { bytes, map }.into());
    }
    Ok(())
}

/// Whether a pixel of this depth becomes a point. The comparisons also turn NaN into "none".
#[inline]
fn is_point(z: f32, max_depth_m: f32) -> bool {
    (z > 0.0) & (z <= max_depth_m) & (z < f32::INFINITY)
}

/// Points of the pixels whose depth (`depth_of` of their value) is above 0 and at most `max_depth_m`.
fn back_project(
    values: &[f32],
    k: &Intrinsics,
    rgb: Option<&[u8]>,
    max_depth_m: f32,
    depth_of: impl Fn(f32) -> f32,
) -> PointCloud {
    let width = k.width as usize;
    // K⁻¹ of a pixel is the column's x, the row's y and 1: computed once per column and once per row.
    let ray_x: Vec<f32> = (0..k.width)
        .map(|u| ((f64::from(u) - k.cx) / k.fx) as f32)
        .collect();
    let mut cloud = PointCloud {
        xyz: Vec::with_capacity(values.len()),
        rgb: rgb.map(|_| Vec::with_capacity(values.len())),
        ..PointCloud::default()
    };
    // One row at a time, in buffers that stay in the L1 cache.
    let mut depths = vec![0.0; width];
    let mut points = vec![[0.0; 3]; width];
    let mut colours = vec![[0; 3]; width];
    for (v, row) in values.chunks_exact(width.max(1)).enumerate() {
        let ray_y = ((v as f64 - k.cy) / k.fy) as f32;
        for (depth, value) in depths.iter_mut().zip(row) {
            let z = depth_of(*value);
            *depth = if is_point(z, max_depth_m) { z } else { 0.0 };
        }
        // Every pixel is written to the next free place, which advances only if the pixel is valid. A branch would be mispredicted too
        // often.
        let mut count = 0;
        for (z, ray_x) in depths.iter().zip(&ray_x) {
            points[count] = [ray_x * z, ray_y * z, *z];
            count += usize::from(*z > 0.0);
        }
        cloud.xyz.extend_from_slice(&points[..count]);
        if let (Some(all), Some(rgb)) = (&mut cloud.rgb, rgb) {
            let (pixels, _) = rgb[3 * v * width..3 * (v + 1) * width].as_chunks::<3>();
            if count == width {
                all.extend_from_slice(pixels);
                continue;
            }
            let mut place = 0;
            for (z, pixel) in depths.iter().zip(pixels) {
                colours[place] = *pixel;
                place += usize::from(*z > 0.0);
            }
            all.extend_from_slice(&colours[..count]);
        }
    }
    cloud
}

#[cfg(test)]
mod tests {
    use super::*;

    fn camera(width: u32, height: u32) -> Intrinsics {
        Intrinsics {
            fx: 2.0,
            fy: 4.0,
            cx: 1.0,
            cy: 0.5,
            width,
            height,
        }
    }

    #[test]
    fn pixels_with_depth_become_coloured_points() {
        let mut depth = DepthMap::empty(3, 2);
        depth.data = vec![0.0, 4.0, 100.0, f32::NAN, 0.0, 8.0];
        let rgb: Vec<u8> = (0..18).collect();
        let cloud = PointCloud::from_depth(&depth, &camera(3, 2), Some(&rgb), 80.0).unwrap();
        // (u, v, z) = (1, 0, 4) and (2, 1, 8): x = (u - 1) / 2 z, y = (v - 0.5) / 4 z.
        assert_eq!(cloud.xyz, vec![[0.0, -0.5, 4.0], [4.0, 1.0, 8.0]]);
        assert_eq!(cloud.rgb, Some(vec![[3, 4, 5], [15, 16, 17]]));
        let values = [1.0, 2.0, 3.0, 4.0, 5.0, 6.0];
        assert_eq!(PointCloud::column(&values, &depth, 80.0), [2.0, 6.0]);
    }

    #[test]
    fn disparity_gives_the_same_points_as_its_depth() {
        let disparity = [0.0, 0.25, 0.01, f32::NAN, -0.5, 0.125];
        let mut depth = DepthMap::empty(3, 2);
        depth.data = disparity.map(|d| 1.0 / d).to_vec();
        let rgb: Vec<u8> = (0..18).collect();
        let k = camera(3, 2);
        let cloud = PointCloud::from_disparity(&disparity, &k, Some(&rgb), 80.0).unwrap();
        assert_eq!(cloud.len(), 2);
        let expected = PointCloud::from_depth(&depth, &k, Some(&rgb), 80.0).unwrap();
        assert_eq!(cloud, expected);
        // Even without a limit, an infinite depth gives no point.
        let all = PointCloud::from_disparity(&disparity, &k, None, f32::INFINITY).unwrap();
        assert_eq!((all.len(), all.rgb), (3, None));
    }

    proptest::proptest! {
        /// Points lie where the camera's own back-projection puts them, to f32's precision.
        #[test]
        fn points_are_where_the_camera_says(
            depths in proptest::collection::vec(-1.0..100.0f32, 35), cx in 0.0..7.0f64, cy in 0.0..5.0f64,
        ) {
            let k = Intrinsics { fx: 5.3, fy: 6.1, cx, cy, width: 7, height: 5 };
            let depth = DepthMap { width: 7, height: 5, data: depths };
            let cloud = PointCloud::from_depth(&depth, &k, None, 80.0).unwrap();
            let kept = depth.data.iter().enumerate().filter(|(_, d)| **d > 0.0 && **d <= 80.0);
            let mut points = cloud.xyz.iter();
            for (i, d) in kept {
                let expected = k.back_project((i % 7) as f64, (i / 7) as f64, f64::from(*d));
                let point = points.next().unwrap();
                for (a, b) in point.iter().zip(expected.iter()) {
                    proptest::prop_assert!((f64::from(*a) - b).abs() <= 3e-7 * b.abs(), "{} {}", a, b);
                }
            }
            proptest::prop_assert!(points.next().is_none());
        }
    }

    #[test]
    fn sizes_that_do_not_fit_are_named() {
        let depth = DepthMap::empty(3, 2);
        let wrong_camera = PointCloud::from_depth(&depth, &camera(4, 2), None, 80.0);
        assert!(wrong_camera.unwrap_err().to_string().contains("4x2"));
        let wrong_image = PointCloud::from_depth(&depth, &camera(3, 2), Some(&[0; 17]), 80.0);
        assert!(wrong_image.unwrap_err().to_string().contains("17 bytes"));
        let wrong_column = PointCloud {
            xyz: vec![[0.0; 3]],
            intensity: Some(vec![]),
            ..PointCloud::default()
        };
        let message = wrong_column.check().unwrap_err().to_string();
        assert!(message.contains("intensity"), "{message}");
    }
}
