//! The sensors' mounting and the camera's intrinsics, after KITTI's car.

use crate::motion::IMU_HEIGHT;
use deepfusion_geometry::{Intrinsics, Se3};
use nalgebra::{Matrix3, Vector3};

/// Height of camera 2 above the road, metres.
pub const CAMERA_HEIGHT: f64 = 1.65;

/// Camera 2 sits this far left of camera 0, metres (KITTI's P_rect_02 has the same 6 cm).
pub const CAM2_FROM_CAM0_X: f64 = 0.06;

/// Where the sensors are on the car.
#[derive(Debug, Clone, Copy)]
pub struct Rig {
    /// Rectified camera 0 from the velodyne.
    pub cam0_from_velo: Se3,
    /// Velodyne from the IMU.
    pub velo_from_imu: Se3,
}

impl Rig {
    /// KITTI's arrangement: the velodyne 27 cm behind the camera and 8 cm above it, turned against
    /// it by fractions of a degree; the IMU 81 cm behind the velodyne and 32 cm left of it.
    pub fn kitti_like() -> Self {
        // Camera axes (right, down, forward) of the vehicle's (forward, left, up).
        let axes = Matrix3::new(0.0, -1.0, 0.0, 0.0, 0.0, -1.0, 1.0, 0.0, 0.0);
        let cam0_from_vehicle_axes = Se3::from_parts(&axes, Vector3::zeros());
        let tilt = Se3::from_axis_angle(Vector3::new(0.004, -0.006, 0.009), Vector3::zeros());
        let cam0_from_velo =
            Se3::from_axis_angle(Vector3::zeros(), Vector3::new(-0.004, -0.076, -0.272))
                * cam0_from_vehicle_axes
                * tilt;
        // The IMU's axes are the vehicle's; its place is given by the height of the camera.
        let velo_in_vehicle = Vector3::new(0.81, -0.32, CAMERA_HEIGHT + 0.076 - IMU_HEIGHT);
        let velo_from_imu =
            tilt.inverse() * Se3::from_axis_angle(Vector3::zeros(), -velo_in_vehicle);
        Self {
            cam0_from_velo,
            velo_from_imu,
        }
    }

    /// Rectified camera 2 from the velodyne.
    pub fn cam_from_velo(&self) -> Se3 {
        Se3::from_axis_angle(Vector3::zeros(), Vector3::new(CAM2_FROM_CAM0_X, 0.0, 0.0))
            * self.cam0_from_velo
    }

    /// Rectified camera 2 from the IMU.
    pub fn cam_from_imu(&self) -> Se3 {
        self.cam_from_velo() * self.velo_from_imu
    }
}

/// KITTI's camera 2, resized to `width` × `height`.
pub fn kitti_like_intrinsics(width: u32, height: u32) -> Intrinsics {
    Intrinsics {
        fx: 721.5377,
        fy: 721.5377,
        cx: 609.5593,
        cy: 172.854,
        width: 1242,
        height: 375,
    }
    .resized(width, height)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_camera_looks_forward_from_its_height() {
        let imu_from_cam = Rig::kitti_like().cam_from_imu().inverse();
        let forward = imu_from_cam.rotate(&Vector3::z());
        assert!((forward - Vector3::x()).norm() < 1e-12, "{forward}");
        let down = imu_from_cam.rotate(&Vector3::y());
        assert!((down + Vector3::z()).norm() < 1e-12, "{down}");
        let position = imu_from_cam.translation();
        assert!((position.z + IMU_HEIGHT - CAMERA_HEIGHT).abs() < 1e-12);
        assert!((position.x - 1.082).abs() < 1e-9, "{position}");
    }

    #[test]
    fn the_size_scales_the_camera() {
        let k = kitti_like_intrinsics(640, 192);
        assert!((k.fx - 371.8).abs() < 0.1 && (k.fy - 369.4).abs() < 0.1);
        assert_eq!(k.implausible(), None);
    }
}
