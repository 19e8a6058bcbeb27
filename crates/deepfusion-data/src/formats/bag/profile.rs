//! What a data set's paper says of its vehicle, for bags that hold none of it. A profile is a file as the one beside a bag; it
//! comes with the program.

use super::config::BagConfig;
use toml::{Table, Value};

/// The profiles by their names. They name no files: there is no folder to look for those in.
const PROFILES: [(&str, &str); 1] = [(
    "umad",
    include_str!(concat!(env!("CARGO_MANIFEST_DIR"), "/profiles/umad.toml")),
)];

/// The keys of mounts.
const MOUNTS: [&str; 3] = ["cam_from_lidar", "cam_from_vehicle", "vehicle_from_imu"];

/// The names that `profile` may be.
pub(super) fn names() -> impl Iterator<Item = &'static str> {
    PROFILES.iter().map(|(name, _)| *name)
}

impl BagConfig {
    /// The table of a bag's file, with what it leaves out as the profile of this name has it. Its camera goes behind
    /// CameraInfo, its mounts behind the bag's frames, and therefore both stay apart. `None` where there is no such profile.
    ///
    /// # Errors
    /// What of either is no such file.
    pub(super) fn over_profile(own: Table, name: &str) -> Option<Result<Self, toml::de::Error>> {
        let (_, text) = PROFILES.iter().find(|(known, _)| *known == name)?;
        let taken_together = || {
            let mut all: Table = toml::from_str(text)?;
            let camera = all.remove("camera").map(Value::try_into).transpose()?;
            let mut mounts = Table::new();
            for name in MOUNTS {
                if !own.contains_key(name)
                    && let Some(mount) = all.remove(name)
                {
                    mounts.insert(name.to_owned(), mount);
                }
            }
            merge(&mut all, own);
            let mut config: Self = all.try_into()?;
            config.profile_camera = camera;
            config.profile_mounts = mounts.try_into()?;
            Ok(config)
        };
        Some(taken_together())
    }
}

/// Puts `own` over `base`, table by table.
fn merge(base: &mut Table, own: Table) {
    for (key, value) in own {
        match (base.get_mut(&key), value) {
            (Some(Value::Table(base)), Value::Table(own)) => merge(base, own),
            (_, value) => {
                base.insert(key, value);
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::Vector3;

    fn umad(own: &str) -> BagConfig {
        let own = toml::from_str(own).unwrap();
        BagConfig::over_profile(own, "umad").unwrap().unwrap()
    }

    /// Each is read as the file beside a bag is, and names no file.
    #[test]
    fn profiles_are_files_as_those_beside_bags() {
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
    fn ahead_of_the_lidar_is_ahead_of_the_camera() {
        let config = umad("");
        assert!(config.cam_from_lidar.is_none());
        let cam_from_lidar = config.profile_mounts.cam_from_lidar.unwrap().se3();
        let ahead = cam_from_lidar.transform(&Vector3::new(10.0, 1.0, 2.0));
        let expected = Vector3::new(-1.0, -2.0 + 0.08, 10.0);
        assert!((ahead - expected).norm() < 1e-9, "{ahead}");
    }

    #[test]
    fn what_the_bags_file_says_goes_before_it() {
        let config =
            umad("[cam_from_lidar]\ntranslation = [0.0, 0.1, 0.0]\nrotation = [0.0, 0.0, 0.0]\n");
        assert_eq!(config.cam_from_lidar.unwrap().translation, [0.0, 0.1, 0.0]);
        assert!(config.profile_mounts.cam_from_lidar.is_none());
        // CameraInfo goes before the profile's camera, the file's own before CameraInfo.
        assert!(config.camera.is_none());
        assert_eq!(config.profile_camera.unwrap().cy, 117.60);
        assert!(BagConfig::over_profile(Table::new(), "kitti").is_none());
    }
}
