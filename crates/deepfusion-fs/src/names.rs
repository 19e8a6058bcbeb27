//! Names that nobody has yet.

use std::collections::hash_map::RandomState;
use std::ffi::OsString;
use std::hash::{BuildHasher, Hasher};
use std::path::{Path, PathBuf};

/// A hidden name beside `target` that nobody else has.
pub(crate) fn temporary_name(target: &Path) -> PathBuf {
    // Threads, processes, and machines that share the folder may write the same target: the last rename wins, whole. A
    // process's number alone would come again after a kill, in a container every time.
    let chance = RandomState::new().build_hasher().finish();
    let mut name = OsString::from(".");
    name.push(target.file_name().unwrap_or_default());
    name.push(format!(".{}-{chance:016x}.partial", std::process::id()));
    target.with_file_name(name)
}

/// `path`, or `path-2`, `path-3` … where that is taken.
#[must_use]
pub fn unused(path: &Path) -> PathBuf {
    let numbered = |n: u32| {
        if n == 1 {
            path.to_owned()
        } else {
            PathBuf::from(format!("{}-{n}", path.display()))
        }
    };
    (1..)
        .map(numbered)
        .find(|p| !p.exists())
        .unwrap_or_else(|| path.to_owned())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_name_that_is_taken_gets_a_number() {
        let dir = tempfile::tempdir().unwrap();
        let (path, second) = (dir.path().join("run"), dir.path().join("run-2"));
        assert_eq!(unused(&path), path);
        std::fs::write(&path, "x").unwrap();
        assert_eq!(unused(&path), second);
        std::fs::create_dir(&second).unwrap();
        assert_eq!(unused(&path), dir.path().join("run-3"));
    }
}
