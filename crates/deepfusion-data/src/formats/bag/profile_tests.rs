use super::super::config::BagConfig;
use super::*;
use nalgebra::Vector3;

fn umad(own: &str) -> BagConfig {
    let own = toml::from_str(own).unwrap();
    BagConfig::with_profile(own, "umad").unwrap().unwrap()
}

/// Each profile is a valid file beside a bag, and names no files.
#[test]
fn profiles_are_valid_bag_configurations() {
    for (name, text) in PROFILES {
        let config: BagConfig = toml::from_str(text).unwrap();
        assert!(
            config.calibration.is_none() && config.can.is_none(),
            "{name}"
        );
        assert!(config.profile.is_none(), "{name}");
    }
}

#[test]
fn umads_lidar_mount_has_the_right_axes() {
    let config = umad("");
    assert!(config.cam_from_lidar.is_none());
    let cam_from_lidar = config.profile_mounts.cam_from_lidar.unwrap().se3();
    let ahead = cam_from_lidar.transform(&Vector3::new(10.0, 1.0, 2.0));
    let expected = Vector3::new(-1.0, -2.0 + 0.08, 10.0);
    assert!((ahead - expected).norm() < 1e-9, "{ahead}");
}

#[test]
fn the_bags_file_takes_precedence_over_the_profile() {
    let config =
        umad("[cam_from_lidar]\ntranslation = [0.0, 0.1, 0.0]\nrotation = [0.0, 0.0, 0.0]\n");
    assert_eq!(config.cam_from_lidar.unwrap().translation, [0.0, 0.1, 0.0]);
    assert!(config.profile_mounts.cam_from_lidar.is_none());
    // CameraInfo takes precedence over the profile's camera, the file's own camera over CameraInfo.
    assert!(config.camera.is_none());
    assert_eq!(config.profile_camera.unwrap().cy, 117.60);
    assert!(BagConfig::with_profile(Table::new(), "kitti").is_none());
}
