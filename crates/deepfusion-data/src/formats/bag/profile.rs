//! What a data set's paper says of its vehicle, for bags that hold none of it. A profile is a file as the one beside a bag; it
//! comes with the program.

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

/// What a bag's file says, completed by a profile.
pub(super) struct Completed {
    /// The whole table, but the profile's camera and mounts.
    pub(super) table: Table,
    /// The profile's camera, which goes behind CameraInfo.
    pub(super) camera: Option<Value>,
    /// Its mounts that the file does not have, which go behind the bag's frames.
    pub(super) mounts: Table,
}

/// The table of a bag's file, with what it leaves out as the profile of this name has it. `None` where there is no such profile.
///
/// # Errors
/// What of the profile is no such file.
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
#[path = "profile_tests.rs"]
mod tests;
