//! A data set's published calibration, for bags that do not contain it. A profile has the format of the file beside a bag, and is
//! included in the program.

use toml::{Table, Value};

/// The profiles by name. They must not name files, since there is no folder to look for them in.
const PROFILES: [(&str, &str); 1] = [(
    "umad",
    include_str!(concat!(env!("CARGO_MANIFEST_DIR"), "/profiles/umad.toml")),
)];

/// The keys of mounts.
const MOUNTS: [&str; 3] = ["cam_from_lidar", "cam_from_vehicle", "vehicle_from_imu"];

/// The known values of `profile`.
pub(super) fn names() -> impl Iterator<Item = &'static str> {
    PROFILES.iter().map(|(name, _)| *name)
}

/// A bag's file, completed by a profile.
pub(super) struct Completed {
    /// The completed table, without the profile's camera and mounts.
    pub(super) table: Table,
    /// The profile's camera; CameraInfo takes precedence.
    pub(super) camera: Option<Value>,
    /// The profile's mounts that the file does not have; the bag's frames take precedence.
    pub(super) mounts: Table,
}

/// A bag's table, completed by the profile of this name; `None` if there is no such profile.
///
/// # Errors
/// If the profile is not valid TOML.
pub(super) fn complete(own: Table, name: &str) -> Option<Result<Completed, toml::de::Error>> {
    let (_, text) = PROFILES.iter().find(|(known, _)| *known == name)?;
    let completed = toml::from_str(text).map(|mut table: Table| {
        let camera = table.remove("camera");
        let mut mounts = Table::new();
        for name in MOUNTS {
            if !own.contains_key(name)
                && let Some(mount) = table.remove(name)
            {
                mounts.insert(name.to_owned(), mount);
            }
        }
        merge(&mut table, own);
        Completed {
            table,
            camera,
            mounts,
        }
    });
    Some(completed)
}

/// Overwrites `base` with the values of `own`, table by table.
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
#[path = "profile_tests.rs"]
mod tests;
