//! Any bytes as each kind of calibration: YAML (OpenCV, ROS, Kalibr), numbers, KITTI's three files. Never a panic,
//! and what is read makes a camera.
//!
//! cargo install cargo-fuzz
//! RUSTC_BOOTSTRAP=1 cargo fuzz run calibration
#![no_main]

use deepfusion_data::{Camera, CameraCalibration, kitti::Calibration};
use libfuzzer_sys::fuzz_target;
use std::path::PathBuf;
use std::sync::LazyLock;

static FOLDER: LazyLock<PathBuf> = LazyLock::new(|| deepfusion_fuzz::scratch("calibration"));
const KITTI: [&str; 3] = [
    Calibration::CAM_TO_CAM,
    Calibration::VELO_TO_CAM,
    Calibration::IMU_TO_VELO,
];

fuzz_target!(|bytes: &[u8]| {
    for name in ["camera.yaml", "camera.txt"] {
        let path = FOLDER.join(name);
        std::fs::write(&path, bytes).expect("a scratch file");
        if let Ok(camera) = CameraCalibration::read(&path, (640, 480)) {
            let k = camera.intrinsics;
            assert!(k.fx > 0.0 && k.fy > 0.0 && k.width > 0 && k.height > 0, "{k:?}");
            let _ = camera.lens();
        }
    }
    for name in KITTI {
        std::fs::write(FOLDER.join(name), bytes).expect("a scratch file");
    }
    for camera in [Camera::Left, Camera::Right] {
        if let Ok(calibration) = Calibration::read(&FOLDER, camera) {
            let _ = calibration.require_cam_from_imu();
            let _ = calibration.require_pixels_from_velo();
        }
    }
});
