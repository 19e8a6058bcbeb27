use crate::{Error, Result};
use deepfusion_geometry::{DepthMap, Intrinsics};

/// Points and what is known of each, column by column. Every column present has one entry a point.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct PointCloud {
    /// Position, in metres.
    pub xyz: Vec<[f32; 3]>,
    /// Colour, 8-bit RGB.
    pub rgb: Option<Vec<[u8; 3]>>,
    /// Strength of the return, in the sensor's own unit (KITTI: 0 to 1).
    pub intensity: Option<Vec<f32>>,
    /// How far the position can be trusted, 0 to 1.
    pub confidence: Option<Vec<f32>>,
}

impl PointCloud {
    /// One point for every pixel that has a depth of at most `max_depth_m`, row by row, in the
    /// camera's frame (x right, y down, z forward; paper Eq. 3).
    ///
    /// `rgb` is the image of the same size, H×W×3 bytes.
    ///
    /// # Errors
    /// [`Error::Size`] where the camera's or the image's size is not the depth map's.
    pub fn from_depth(
        depth: &DepthMap,
        k: &Intrinsics,
        rgb: Option<&[u8]>,
        max_depth_m: f32,
    ) -> Result<Self> {
        let (width, height) = (depth.width, depth.height);
        if (k.width as usize, k.height as usize) != (width, height) {
            return Err(Error::Size {
                what: "camera intrinsics",
                found: format!("{}x{}", k.width, k.height),
                expected: format!("the depth map's {width}x{height}"),
            });
        }
        if let Some(bytes) = rgb
            && bytes.len() != width * height * 3
        {
            return Err(Error::Size {
                what: "colour image",
                found: format!("{} bytes", bytes.len()),
                expected: format!("{} ({width}x{height}x3)", width * height * 3),
            });
        }
        let mut xyz = Vec::new();
        let mut colours = rgb.map(|_| Vec::new());
        for (i, &d) in depth.data.iter().enumerate() {
            // The comparison also leaves NaN and infinity out.
            if !(d > 0.0 && d <= max_depth_m && d.is_finite()) {
                continue;
            }
            let point = k.back_project((i % width) as f64, (i / width) as f64, f64::from(d));
            xyz.push([point.x as f32, point.y as f32, point.z as f32]);
            if let (Some(colours), Some(bytes)) = (&mut colours, rgb) {
                colours.push([bytes[3 * i], bytes[3 * i + 1], bytes[3 * i + 2]]);
            }
        }
        Ok(Self {
            xyz,
            rgb: colours,
            ..Self::default()
        })
    }

    /// How many points.
    #[must_use]
    pub fn len(&self) -> usize {
        self.xyz.len()
    }

    /// Whether there is no point.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.xyz.is_empty()
    }

    /// Checks that every column present has one entry a point.
    ///
    /// # Errors
    /// [`Error::Size`], naming the column.
    pub fn check(&self) -> Result<()> {
        let columns = [
            ("rgb", self.rgb.as_ref().map(Vec::len)),
            ("intensity", self.intensity.as_ref().map(Vec::len)),
            ("confidence", self.confidence.as_ref().map(Vec::len)),
        ];
        for (what, len) in columns {
            if let Some(len) = len.filter(|len| *len != self.len()) {
                return Err(Error::Size {
                    what,
                    found: format!("{len} entries"),
                    expected: format!("one a point, {}", self.len()),
                });
            }
        }
        Ok(())
    }
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
