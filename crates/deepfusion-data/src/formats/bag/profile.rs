//! Numbers that a data set's paper prints, for bags that hold none.

use super::config::{CameraConfig, Transform};
use std::f64::consts::FRAC_PI_2;

/// UMAD's camera as printed. Its centre's row is implausible for 480 rows; it is not corrected here, `doctor` and the
/// inspection say so.
pub(super) const UMAD_CAMERA: CameraConfig = CameraConfig {
    fx: 703.64,
    fy: 724.82,
    cx: 322.55,
    cy: 117.60,
    width: 640,
    height: 480,
};

/// UMAD's LiDAR sits 80 mm below the camera, its axes (forward, left, up) turned to the camera's (right, down,
/// forward): 120° about (1, −1, 1)/√3 reversed. The paper prints no rotation beyond that.
pub(super) fn umad_cam_from_lidar() -> Transform {
    // Rotation vector of the axes' permutation: 2π/3 about (1, −1, 1)/√3.
    let angle = 4.0 / 3.0 * FRAC_PI_2 / 3.0_f64.sqrt();
    Transform {
        translation: [0.0, 0.08, 0.0],
        rotation: [angle, -angle, angle],
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::Vector3;

    #[test]
    fn ahead_of_the_lidar_is_ahead_of_the_camera() {
        let cam_from_lidar = umad_cam_from_lidar().se3();
        let ahead = cam_from_lidar.transform(&Vector3::new(10.0, 1.0, 2.0));
        let expected = Vector3::new(-1.0, -2.0 + 0.08, 10.0);
        assert!((ahead - expected).norm() < 1e-9, "{ahead}");
    }
}
