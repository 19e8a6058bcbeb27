//! The three calibration files of a date.

use crate::{Camera, Error, Result};
use deepfusion_geometry::{Intrinsics, Se3};
use nalgebra::{Matrix3, Matrix3x4, Matrix4, Vector3};
use std::collections::HashMap;
use std::path::{Path, PathBuf};

/// How one rectified colour camera sees the world, and where it sits on the car.
///
/// Frames: camera x right, y down, z forward; velodyne and IMU x forward, y left, z up. Metres.
#[derive(Debug, Clone, PartialEq)]
pub struct Calibration {
    /// The camera these values are of.
    pub camera: Camera,
    /// Of the rectified image (`P_rect`, `S_rect`), in pixels.
    pub intrinsics: Intrinsics,
    /// A velodyne point in the rectified camera: `R_rect_00`, velo_to_cam and the offset of this camera
    /// from camera 0 that `P_rect` holds. `None` without calib_velo_to_cam.txt.
    pub cam_from_velo: Option<Se3>,
    /// An IMU point in the rectified camera. `None` without calib_velo_to_cam.txt or calib_imu_to_velo.txt.
    pub cam_from_imu: Option<Se3>,
    /// The product P_rect · R_rect_00 · cam0_from_velo (3×4, homogeneous pixels and camera z from a
    /// velodyne point), from the matrices as printed. [`Se3`] projects a rotation onto the nearest
    /// orthonormal one; ground truth that must agree with the field's to the pixel cannot.
    pub pixels_from_velo: Option<Matrix3x4<f64>>,
    /// The folder the files were read from.
    pub folder: PathBuf,
}

impl Calibration {
    /// File of the cameras' intrinsics and rectification.
    pub const CAM_TO_CAM: &str = "calib_cam_to_cam.txt";
    /// File of the velodyne's place.
    pub const VELO_TO_CAM: &str = "calib_velo_to_cam.txt";
    /// File of the IMU's place.
    pub const IMU_TO_VELO: &str = "calib_imu_to_velo.txt";

    /// Reads the calibration files of the date folder `folder` for one camera.
    ///
    /// # Errors
    /// [`Error::Missing`] without calib_cam_to_cam.txt (the other two may be absent),
    /// [`Error::Calibration`] where a field is absent, is not numbers or makes no camera.
    pub fn read(folder: &Path, camera: Camera) -> Result<Self> {
        let cameras = Fields::read(&folder.join(Self::CAM_TO_CAM))?
            .ok_or_else(|| missing(folder, Self::CAM_TO_CAM, "the cameras' intrinsics"))?;
        let number = camera.number();
        let (size_field, p_field) = (format!("S_rect_0{number}"), format!("P_rect_0{number}"));
        let size = cameras.numbers::<2>(&size_field)?;
        let p_rect = Matrix3x4::from_row_slice(&cameras.numbers::<12>(&p_field)?);
        let intrinsics = Intrinsics {
            fx: p_rect[(0, 0)],
            fy: p_rect[(1, 1)],
            cx: p_rect[(0, 2)],
            cy: p_rect[(1, 2)],
            width: cameras.size(&size_field, size[0])?,
            height: cameras.size(&size_field, size[1])?,
        };
        if let Some(problem) = intrinsics.implausible() {
            return Err(cameras.error(&p_field, problem));
        }
        let r_rect = Matrix3::from_row_slice(&cameras.numbers::<9>("R_rect_00")?);
        // P_rect = K [I | t]: t = K⁻¹ p₄ is where rectified camera 0's origin lies for this camera.
        let p4 = Vector3::new(p_rect[(0, 3)], p_rect[(1, 3)], p_rect[(2, 3)]);
        let cam_from_rect0 =
            Se3::from_parts(&Matrix3::identity(), intrinsics.inverse_matrix() * p4);
        let rect0_from_cam0 = Se3::from_parts(&r_rect, Vector3::zeros());

        let mut calibration = Self {
            camera,
            intrinsics,
            cam_from_velo: None,
            cam_from_imu: None,
            pixels_from_velo: None,
            folder: folder.to_owned(),
        };
        if let Some(fields) = Fields::read(&folder.join(Self::VELO_TO_CAM))? {
            let cam0_from_velo = fields.rigid()?;
            let rect0_from_velo = homogeneous(&r_rect, &Vector3::zeros())
                * homogeneous(&cam0_from_velo.0, &cam0_from_velo.1);
            calibration.pixels_from_velo = Some(p_rect * rect0_from_velo);
            let cam_from_velo = cam_from_rect0
                * rect0_from_cam0
                * Se3::from_parts(&cam0_from_velo.0, cam0_from_velo.1);
            calibration.cam_from_velo = Some(cam_from_velo);
            if let Some(fields) = Fields::read(&folder.join(Self::IMU_TO_VELO))? {
                let (rotation, translation) = fields.rigid()?;
                calibration.cam_from_imu =
                    Some(cam_from_velo * Se3::from_parts(&rotation, translation));
            }
        }
        Ok(calibration)
    }

    /// [`Self::cam_from_imu`], or an error that names the file it lacks.
    ///
    /// # Errors
    /// [`Error::Missing`].
    pub fn require_cam_from_imu(&self) -> Result<Se3> {
        self.cam_from_imu.ok_or_else(|| {
            if self.cam_from_velo.is_none() {
                missing(&self.folder, Self::VELO_TO_CAM, "the velodyne's place")
            } else {
                missing(&self.folder, Self::IMU_TO_VELO, "the IMU's place")
            }
        })
    }

    /// [`Self::pixels_from_velo`], or an error that names the file it lacks.
    ///
    /// # Errors
    /// [`Error::Missing`].
    pub fn require_pixels_from_velo(&self) -> Result<Matrix3x4<f64>> {
        self.pixels_from_velo
            .ok_or_else(|| missing(&self.folder, Self::VELO_TO_CAM, "the velodyne's place"))
    }
}

fn missing(folder: &Path, file: &str, what: &'static str) -> Error {
    Error::Missing {
        path: folder.join(file),
        what,
        remedy: "put the calibration files of that date (KITTI offers them as <date>_calib.zip) into the date folder",
    }
}

fn homogeneous(rotation: &Matrix3<f64>, translation: &Vector3<f64>) -> Matrix4<f64> {
    let mut m = Matrix4::identity();
    m.fixed_view_mut::<3, 3>(0, 0).copy_from(rotation);
    m.fixed_view_mut::<3, 1>(0, 3).copy_from(translation);
    m
}

/// The `name: values` lines of a calibration file.
struct Fields {
    path: PathBuf,
    values: HashMap<String, String>,
}

impl Fields {
    /// `None` where the file does not exist.
    fn read(path: &Path) -> Result<Option<Self>> {
        let bytes = match std::fs::read(path) {
            Ok(bytes) => bytes,
            Err(e) if e.kind() == std::io::ErrorKind::NotFound => return Ok(None),
            Err(e) => return Err(Error::file(path, e)),
        };
        let text = String::from_utf8_lossy(&bytes);
        let values = text
            .lines()
            .filter_map(|line| line.split_once(':'))
            .map(|(name, values)| (name.trim().to_owned(), values.trim().to_owned()))
            .collect();
        Ok(Some(Self {
            path: path.to_owned(),
            values,
        }))
    }

    fn error(&self, field: &str, problem: String) -> Error {
        Error::Calibration {
            path: self.path.clone(),
            field: field.to_owned(),
            problem,
        }
    }

    /// Exactly `N` finite numbers.
    fn numbers<const N: usize>(&self, field: &str) -> Result<[f64; N]> {
        let text = self
            .values
            .get(field)
            .ok_or_else(|| self.error(field, "the file has no such line".into()))?;
        let mut numbers = [0.0; N];
        let mut count = 0;
        for word in text.split_whitespace() {
            let number: f64 = word
                .parse()
                .map_err(|_| self.error(field, format!("'{word}' is not a number")))?;
            if !number.is_finite() {
                return Err(self.error(field, format!("'{word}' is not finite")));
            }
            if let Some(slot) = numbers.get_mut(count) {
                *slot = number;
            }
            count += 1;
        }
        if count != N {
            return Err(self.error(field, format!("{count} numbers, expected {N}")));
        }
        Ok(numbers)
    }

    fn rigid(&self) -> Result<(Matrix3<f64>, Vector3<f64>)> {
        let rotation = Matrix3::from_row_slice(&self.numbers::<9>("R")?);
        if (rotation * rotation.transpose() - Matrix3::identity()).norm() > 1e-2
            || rotation.determinant() < 0.0
        {
            return Err(self.error("R", "is not a rotation".into()));
        }
        Ok((rotation, Vector3::from(self.numbers::<3>("T")?)))
    }

    fn size(&self, field: &str, value: f64) -> Result<u32> {
        if value.fract() == 0.0 && (1.0..=65_535.0).contains(&value) {
            Ok(value as u32)
        } else {
            Err(self.error(field, format!("{value} is not a size in pixels")))
        }
    }
}
