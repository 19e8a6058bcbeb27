//! Reads the three calibration files of a date.

use super::fields::{Fields, cam_from_cam0};
use crate::{Camera, Error, MissingPart, Result};
use deepfusion_geometry::{Intrinsics, Se3};
use nalgebra::{Matrix3, Matrix3x4, Matrix4, Vector3};
use std::path::{Path, PathBuf};

/// Intrinsics and mount of one rectified colour camera.
///
/// Frames: camera x right, y down, z forward; velodyne and IMU x forward, y left, z up. Metres.
#[derive(Debug, Clone, PartialEq)]
pub struct Calibration {
    /// The camera to which these values belong.
    pub camera: Camera,
    /// Intrinsics of the rectified image (`P_rect`, `S_rect`), in pixels.
    pub intrinsics: Intrinsics,
    /// Transforms points from the velodyne to the rectified camera: `R_rect_00`, velo_to_cam and the offset of this camera
    /// from camera 0 in `P_rect`. `None` without calib_velo_to_cam.txt.
    pub cam_from_velo: Option<Se3>,
    /// Transforms points from the IMU to the rectified camera. `None` without calib_velo_to_cam.txt or calib_imu_to_velo.txt.
    pub cam_from_imu: Option<Se3>,
    /// The product P_rect · R_rect_00 · cam0_from_velo (3×4, from a velodyne point to homogeneous pixels and camera z),
    /// from the matrices as printed. It is needed for ground truth that agrees with the published one to the pixel, since [`Se3`]
    /// projects a rotation onto the nearest orthonormal one.
    pub pixels_from_velo: Option<Matrix3x4<f64>>,
    /// Path of the folder from which the files were read.
    pub folder: PathBuf,
}

impl Calibration {
    /// Name of the file with the cameras' intrinsics and rectification.
    pub const CAM_TO_CAM: &str = "calib_cam_to_cam.txt";
    /// Name of the file with the velodyne's mount.
    pub const VELO_TO_CAM: &str = "calib_velo_to_cam.txt";
    /// Name of the file with the IMU's mount.
    pub const IMU_TO_VELO: &str = "calib_imu_to_velo.txt";

    /// Reads the calibration files of the date folder `folder` for one camera.
    ///
    /// # Errors
    /// [`Error::Missing`] without calib_cam_to_cam.txt (the other two may be missing),
    /// [`Error::Calibration`] if a field is missing, not numeric or implausible.
    pub fn read(folder: &Path, camera: Camera) -> Result<Self> {
        let cameras = Fields::read(&folder.join(Self::CAM_TO_CAM))?
            .ok_or_else(|| missing(folder, Self::CAM_TO_CAM, MissingPart::Intrinsics))?;
        let number = camera.number();
        let (size_field, p_field) = (format!("S_rect_0{number}"), format!("P_rect_0{number}"));
        let size = cameras.numbers::<2>(&size_field)?;
        let p_rect = Matrix3x4::from_row_slice(&cameras.numbers::<12>(&p_field)?);
        let size = (
            cameras.size(&size_field, size[0])?,
            cameras.size(&size_field, size[1])?,
        );
        let intrinsics = cameras.camera(&p_field, &p_rect, size)?;
        let r_rect = Matrix3::from_row_slice(&cameras.numbers::<9>("R_rect_00")?);
        let cam_from_rect0 = cam_from_cam0(&intrinsics, &p_rect);
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

    /// [`Self::cam_from_imu`], or an error that names the missing file.
    ///
    /// # Errors
    /// [`Error::Missing`].
    pub fn require_cam_from_imu(&self) -> Result<Se3> {
        self.cam_from_imu.ok_or_else(|| {
            if self.cam_from_velo.is_none() {
                missing(&self.folder, Self::VELO_TO_CAM, MissingPart::VelodynePlace)
            } else {
                missing(&self.folder, Self::IMU_TO_VELO, MissingPart::ImuPlace)
            }
        })
    }

    /// [`Self::pixels_from_velo`], or an error that names the missing file.
    ///
    /// # Errors
    /// [`Error::Missing`].
    pub fn require_pixels_from_velo(&self) -> Result<Matrix3x4<f64>> {
        self.pixels_from_velo
            .ok_or_else(|| missing(&self.folder, Self::VELO_TO_CAM, MissingPart::VelodynePlace))
    }
}

fn missing(folder: &Path, file: &str, part: MissingPart) -> Error {
    Error::Missing {
        path: folder.join(file),
        part,
    }
}

fn homogeneous(rotation: &Matrix3<f64>, translation: &Vector3<f64>) -> Matrix4<f64> {
    let mut m = Matrix4::identity();
    m.fixed_view_mut::<3, 3>(0, 0).copy_from(rotation);
    m.fixed_view_mut::<3, 1>(0, 3).copy_from(translation);
    m
}
