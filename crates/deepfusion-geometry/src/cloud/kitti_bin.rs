//! Binary scans: KITTI's velodyne scans (x, y, z, intensity as little-endian f32, nothing else) and those of nuScenes (with a ring index in
//! addition).

use super::{Error, PointCloud, Result};
use deepfusion_fs::FileError;
use std::io::Write;
use std::path::Path;

const POINT_BYTES: usize = 16;
const NUSCENES_POINT_BYTES: usize = 20;

impl PointCloud {
    /// Reads a KITTI velodyne scan: points in the sensor's frame (x forward, y left, z up), in
    /// metres, with intensity.
    ///
    /// # Errors
    /// [`Error::File`] if it cannot be read, [`Error::Truncated`] if it ends within a point.
    pub fn read_kitti_bin(path: &Path) -> Result<Self> {
        Self::read_bin(path, POINT_BYTES)
    }

    /// Reads a scan of nuScenes' LIDAR_TOP (`.pcd.bin`: x, y, z, intensity, ring), in metres, with intensity. The file's axes (x right, y
    /// forward, z up) are converted to KITTI's (x forward, y left, z up).
    ///
    /// # Errors
    /// As [`Self::read_kitti_bin`].
    pub fn read_nuscenes_bin(path: &Path) -> Result<Self> {
        let mut cloud = Self::read_bin(path, NUSCENES_POINT_BYTES)?;
        for point in &mut cloud.xyz {
            let [x, y, z] = *point;
            *point = [y, -x, z];
        }
        Ok(cloud)
    }

    /// Reads points of `size` bytes, whose first four values are x, y, z and intensity.
    fn read_bin(path: &Path, size: usize) -> Result<Self> {
        let bytes = std::fs::read(path).map_err(|source| FileError::new(path, source))?;
        if bytes.len() % size != 0 {
            return Err(Error::Truncated {
                path: path.to_owned(),
                bytes: bytes.len() as u64,
                point: size,
            });
        }
        let (mut xyz, mut intensity) = (Vec::new(), Vec::new());
        for point in bytes.chunks_exact(size) {
            let value =
                |i: usize| f32::from_le_bytes([point[i], point[i + 1], point[i + 2], point[i + 3]]);
            xyz.push([value(0), value(4), value(8)]);
            intensity.push(value(12));
        }
        Ok(Self {
            xyz,
            intensity: Some(intensity),
            ..Self::default()
        })
    }

    /// Writes the points as a KITTI velodyne scan; an absent intensity is written as 0.
    ///
    /// # Errors
    /// [`Error::Stream`] if writing fails, [`Error::Size`] if a column does not fit.
    pub fn write_kitti_bin(&self, mut out: impl Write) -> Result<()> {
        self.check()?;
        let mut bytes = Vec::with_capacity(self.len() * POINT_BYTES);
        for (i, point) in self.xyz.iter().enumerate() {
            let intensity = self.intensity.as_ref().map_or(0.0, |column| column[i]);
            for value in point.iter().chain([&intensity]) {
                bytes.extend_from_slice(&value.to_le_bytes());
            }
        }
        Ok(out.write_all(&bytes)?)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use deepfusion_hint::Hint;

    #[test]
    fn a_scan_survives_the_file() {
        let cloud = PointCloud {
            xyz: vec![[1.5, -2.0, 0.25], [80.0, 3.0, -1.7]],
            intensity: Some(vec![0.5, 0.0]),
            ..PointCloud::default()
        };
        let file = tempfile::NamedTempFile::new().unwrap();
        cloud.write_kitti_bin(file.as_file()).unwrap();
        assert_eq!(PointCloud::read_kitti_bin(file.path()).unwrap(), cloud);
    }

    /// A point 12 m ahead and 3 m to the right, as in a file of nuScenes.
    #[test]
    fn a_scan_of_nuscenes_is_rotated_to_kittis_axes() {
        let file = tempfile::NamedTempFile::new().unwrap();
        let values: [f32; 5] = [3.0, 12.0, -1.5, 40.0, 7.0];
        let bytes: Vec<u8> = values.iter().flat_map(|v| v.to_le_bytes()).collect();
        std::fs::write(file.path(), &bytes).unwrap();
        let cloud = PointCloud::read_nuscenes_bin(file.path()).unwrap();
        assert_eq!(cloud.xyz, [[12.0, -3.0, -1.5]]);
        assert_eq!(cloud.intensity, Some(vec![40.0]));
        std::fs::write(file.path(), &bytes[..16]).unwrap();
        let error = PointCloud::read_nuscenes_bin(file.path()).unwrap_err();
        assert!(error.to_string().contains("20 bytes each"), "{error}");
    }

    #[test]
    fn a_truncated_scan_is_an_error_that_names_it() {
        let file = tempfile::NamedTempFile::new().unwrap();
        std::fs::write(file.path(), [0_u8; 33]).unwrap();
        let error = PointCloud::read_kitti_bin(file.path()).unwrap_err();
        assert!(error.to_string().contains("33 bytes"), "{error}");
        assert!(error.to_string().contains(file.path().to_str().unwrap()));
        assert!(error.hint().is_some());
        let missing = PointCloud::read_kitti_bin(Path::new("no/such/scan.bin")).unwrap_err();
        assert_eq!(
            missing.to_string(),
            "no/such/scan.bin: no such file or folder"
        );
    }
}
