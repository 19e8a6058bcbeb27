//! The sensors' mounting and the camera's intrinsics, after KITTI's car or UMAD's.

use crate::motion::{IMU_HEIGHT, rotation};
use deepfusion_geometry::{Intrinsics, Se3};
use nalgebra::{Matrix3, Vector3};

/// Default height of camera 2 above the road, metres.
pub(crate) const CAMERA_HEIGHT: f64 = 1.65;

/// Camera 2 sits this far left of camera 0, metres (KITTI's P_rect_02 has the same 6 cm).
pub(crate) const CAM2_FROM_CAM0_X: f64 = 0.06;

/// Camera axes (right, down, forward) in the vehicle's (forward, left, up).
pub(crate) const VEHICLE_FROM_CAM_AXES: Matrix3<f64> =
    Matrix3::new(0.0, 0.0, 1.0, -1.0, 0.0, 0.0, 0.0, -1.0, 0.0);

/// The mounts of the sensors on the car. "The IMU" is KITTI's: it represents the car itself, above the middle of
/// the rear axle.
#[derive(Debug, Clone, Copy)]
pub struct Rig {
    /// Rectified camera 0 from the velodyne (with UMAD: from the FMCW LiDAR).
    pub cam0_from_velo: Se3,
    /// Velodyne from the IMU.
    pub velo_from_imu: Se3,
    /// The 6-axis unit in the sensor head from the IMU; the identity if the IMU is the only unit.
    pub head_imu_from_imu: Se3,
}

impl Rig {
    /// KITTI's arrangement: the velodyne 27 cm behind the camera and 8 cm above it, turned against
    /// it by fractions of a degree; the IMU 81 cm behind the velodyne and 32 cm left of it.
    pub fn kitti_like(camera_height_m: f64) -> Self {
        let axes = VEHICLE_FROM_CAM_AXES.transpose();
        let cam0_from_vehicle_axes = Se3::from_parts(&axes, Vector3::zeros());
        let tilt = Se3::from_axis_angle(Vector3::new(0.004, -0.006, 0.009), Vector3::zeros());
        let cam0_from_velo =
            Se3::from_axis_angle(Vector3::zeros(), Vector3::new(-0.004, -0.076, -0.272))
                * cam0_from_vehicle_axes
                * tilt;
        // The IMU's axes are the vehicle's; its position follows from the camera's height.
        let velo_in_vehicle = Vector3::new(0.81, -0.32, camera_height_m + 0.076 - IMU_HEIGHT);
        let velo_from_imu =
            tilt.inverse() * Se3::from_axis_angle(Vector3::zeros(), -velo_in_vehicle);
        Self {
            cam0_from_velo,
            velo_from_imu,
            head_imu_from_imu: Se3::identity(),
        }
    }

    /// UMAD's arrangement on a roof: the camera 80 mm above the LiDAR, a 6-axis unit 50 mm behind it, all of them 1.6 m ahead of the rear
    /// axle; the LiDAR turned against the car by fractions of a degree.
    pub fn umad_like(camera_height_m: f64) -> Self {
        let axes = VEHICLE_FROM_CAM_AXES.transpose();
        let cam_axes_from_vehicle_axes = Se3::from_parts(&axes, Vector3::zeros());
        let shift = |x, y, z| Se3::from_axis_angle(Vector3::zeros(), Vector3::new(x, y, z));
        let tilt = Se3::from_axis_angle(Vector3::new(0.003, -0.005, 0.006), Vector3::zeros());
        let lidar_height = camera_height_m - 0.08 - IMU_HEIGHT;
        Self {
            cam0_from_velo: shift(-CAM2_FROM_CAM0_X, 0.08, 0.0) * cam_axes_from_vehicle_axes * tilt,
            velo_from_imu: tilt.inverse() * shift(-1.6, 0.0, -lidar_height),
            head_imu_from_imu: shift(-1.55, 0.0, -lidar_height),
        }
    }

    /// The same rig with camera 2 turned about its own centre, in radians: `pitch` turns it down, `roll` clockwise in the viewing
    /// direction. The other sensors keep their poses.
    pub(crate) fn with_camera_turned(self, pitch: f64, roll: f64) -> Self {
        let axes = VEHICLE_FROM_CAM_AXES;
        let level_from_turned = axes.transpose() * rotation(0.0, pitch, roll) * axes;
        let turned_from_level = Se3::from_parts(&level_from_turned.transpose(), Vector3::zeros());
        Self {
            cam0_from_velo: cam2_from_cam0().inverse() * turned_from_level * self.cam_from_velo(),
            ..self
        }
    }

    /// Rectified camera 2 from the velodyne.
    pub fn cam_from_velo(&self) -> Se3 {
        cam2_from_cam0() * self.cam0_from_velo
    }

    /// Rectified camera 2 from the IMU.
    pub fn cam_from_imu(&self) -> Se3 {
        self.cam_from_velo() * self.velo_from_imu
    }
}

/// Rectified camera 2 from rectified camera 0.
fn cam2_from_cam0() -> Se3 {
    Se3::from_axis_angle(Vector3::zeros(), Vector3::new(CAM2_FROM_CAM0_X, 0.0, 0.0))
}

/// KITTI's camera 2, resized to `width` × `height`.
pub(crate) fn kitti_like_intrinsics(width: u32, height: u32) -> Intrinsics {
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

/// UMAD's camera as the paper prints it, 640×480, except for the row of its centre: the printed 117.6 is
/// implausible for 480 rows, and the middle is used instead. Resized to `width` × `height`.
pub(crate) fn umad_like_intrinsics(width: u32, height: u32) -> Intrinsics {
    Intrinsics {
        fx: 703.64,
        fy: 724.82,
        cx: 322.55,
        cy: 239.5,
        width: 640,
        height: 480,
    }
    .resized(width, height)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_roof_s_sensors_are_placed_as_in_the_paper() {
        let rig = Rig::umad_like(CAMERA_HEIGHT);
        let lidar_from_cam = rig.cam_from_velo().inverse();
        let above = lidar_from_cam.translation();
        assert!(
            (above.norm() - 0.08).abs() < 1e-12 && above.z > 0.079,
            "{above}"
        );
        let imu_from_cam = rig.cam_from_imu().inverse();
        assert!((imu_from_cam.translation().z + IMU_HEIGHT - CAMERA_HEIGHT).abs() < 1e-9);
        assert!((imu_from_cam.rotate(&Vector3::z()) - Vector3::x()).norm() < 1e-9);
        let head_from_lidar = rig.head_imu_from_imu * rig.velo_from_imu.inverse();
        assert!((head_from_lidar.translation() - Vector3::new(0.05, 0.0, 0.0)).norm() < 1e-9);
    }

    #[test]
    fn the_camera_looks_forward_from_its_height() {
        let imu_from_cam = Rig::kitti_like(CAMERA_HEIGHT).cam_from_imu().inverse();
        let forward = imu_from_cam.rotate(&Vector3::z());
        assert!((forward - Vector3::x()).norm() < 1e-12, "{forward}");
        let down = imu_from_cam.rotate(&Vector3::y());
        assert!((down + Vector3::z()).norm() < 1e-12, "{down}");
        let position = imu_from_cam.translation();
        assert!((position.z + IMU_HEIGHT - CAMERA_HEIGHT).abs() < 1e-12);
        assert!((position.x - 1.082).abs() < 1e-9, "{position}");
    }

    #[test]
    fn turning_the_camera_keeps_its_position() {
        for level in [Rig::kitti_like(1.2), Rig::umad_like(1.2)] {
            let turned = level.with_camera_turned(0.1, 0.05);
            let (before, after) = (
                level.cam_from_imu().inverse(),
                turned.cam_from_imu().inverse(),
            );
            assert!((before.translation() - after.translation()).norm() < 1e-9);
            let (forward, right) = (after.rotate(&Vector3::z()), after.rotate(&Vector3::x()));
            // Pitch turns it down and not sideways; roll turns it clockwise, so its right side is lower.
            assert!((forward.z + 0.1f64.sin()).abs() < 1e-9 && forward.y.abs() < 1e-9);
            let lower = 0.1f64.cos() * 0.05f64.sin();
            assert!((right.z + lower).abs() < 1e-9, "{right}");
            assert_eq!(turned.velo_from_imu, level.velo_from_imu);
        }
    }

    #[test]
    fn the_size_scales_the_camera() {
        let k = kitti_like_intrinsics(640, 192);
        assert!((k.fx - 371.8).abs() < 0.1 && (k.fy - 369.4).abs() < 0.1);
        assert_eq!(k.implausible(), None);
    }
}
