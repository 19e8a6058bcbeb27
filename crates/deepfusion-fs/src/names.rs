//! Unused names for files and folders.

use std::borrow::Cow;
use std::collections::hash_map::RandomState;
use std::ffi::OsString;
use std::hash::{BuildHasher, Hasher};
use std::io;
use std::path::{Path, PathBuf};

/// The most bytes of the target's name in a temporary name. File systems allow names of up to 255 bytes, of which the dots, the process id,
/// the random number, `.partial` and `.lock` take 42.
const LONGEST: usize = 213;

/// A hidden, unused name beside `target`.
pub(crate) fn temporary_name(target: &Path) -> PathBuf {
    // Threads, processes and machines that share the folder may write the same target: the last rename wins, with its whole file. A process
    // id alone could recur after a kill; in a container it always does.
    let chance = RandomState::new().build_hasher().finish();
    let target_name = target.file_name().unwrap_or_default();
    let mut name = OsString::from(".");
    if target_name.len() <= LONGEST {
        name.push(target_name);
    } else {
        name.push(&*shortened(&target_name.to_string_lossy()));
    }
    name.push(format!(".{}-{chance:016x}.partial", std::process::id()));
    target.with_file_name(name)
}

/// A target's name as used in a temporary name: one that is too long is cut, and ends in a checksum of the whole name.
pub(crate) fn shortened(name: &str) -> Cow<'_, str> {
    if name.len() <= LONGEST {
        return Cow::Borrowed(name);
    }
    let checksum = format!("~{:08x}", crc32fast::hash(name.as_bytes()));
    let mut end = LONGEST - checksum.len();
    while !name.is_char_boundary(end) {
        end -= 1;
    }
    Cow::Owned(format!("{}{checksum}", &name[..end]))
}

/// `path`, with `from` replaced by `to` if it begins with `from`. For errors: they outlive the temporary file, and should name its target.
#[must_use]
pub fn moved_path(path: PathBuf, from: &Path, to: &Path) -> PathBuf {
    let moved = path.strip_prefix(from).map(|rest| to.join(rest));
    moved.unwrap_or(path)
}

/// An absolute path. An empty path stays as it is, and so does any path if the working directory is gone: opening it then fails.
#[must_use]
pub fn absolute(path: &Path) -> PathBuf {
    std::path::absolute(path).unwrap_or_else(|_| path.to_owned())
}

/// `path`, or `path-2`, `path-3` … if that is taken.
#[must_use]
pub fn unused(path: &Path) -> PathBuf {
    numbered(path)
        .find(|p| !p.exists())
        .unwrap_or_else(|| path.to_owned())
}

/// Makes the folder `path`, or `path-2`, `path-3` … if that is taken; its parent must exist. Two processes that do this at the same time
/// get different folders.
///
/// # Errors
/// The system's error.
pub fn create_unused(path: &Path) -> io::Result<PathBuf> {
    for folder in numbered(path) {
        match std::fs::create_dir(&folder) {
            Ok(()) => return Ok(folder),
            Err(error) if error.kind() == io::ErrorKind::AlreadyExists => {}
            Err(error) => return Err(error),
        }
    }
    Err(io::ErrorKind::AlreadyExists.into())
}

/// `path`, `path-2`, `path-3` and so on.
fn numbered(path: &Path) -> impl Iterator<Item = PathBuf> {
    (1_u32..).map(move |n| {
        if n == 1 {
            path.to_owned()
        } else {
            PathBuf::from(format!("{}-{n}", path.display()))
        }
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::collections::HashSet;

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

    /// All threads look for a free name before any of them makes its folder.
    #[test]
    fn folders_made_at_the_same_time_are_different() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("run");
        let made: HashSet<PathBuf> = std::thread::scope(|scope| {
            let asked = [(); 8].map(|()| scope.spawn(|| create_unused(&path).unwrap()));
            asked.into_iter().map(|made| made.join().unwrap()).collect()
        });
        assert_eq!(made.len(), 8);
        assert!(made.iter().all(|folder| folder.is_dir()));
        assert!(create_unused(&dir.path().join("no/run")).is_err());
    }

    #[test]
    fn a_long_name_is_cut_and_stays_unique() {
        assert_eq!(shortened("a_depth.png"), "a_depth.png");
        let fits = "x".repeat(LONGEST);
        assert_eq!(shortened(&fits), fits);
        let (a, b) = (format!("{fits}a"), format!("{fits}b"));
        assert_ne!(shortened(&a), shortened(&b));
        for name in [a.as_str(), &"\u{e4}".repeat(120), &"x\u{1F600}".repeat(50)] {
            assert!(shortened(name).len() <= LONGEST, "{}", shortened(name));
            let temporary = temporary_name(&Path::new("out").join(name));
            assert_eq!(temporary.parent(), Some(Path::new("out")));
            let longest = temporary.file_name().unwrap().len() + ".lock".len();
            assert!(longest <= 255, "{longest}");
        }
    }

    #[test]
    fn a_path_is_made_absolute_and_an_empty_one_stays() {
        let made = absolute(Path::new("a/b"));
        assert!(made.is_absolute() && made.ends_with("a/b"), "{made:?}");
        assert_eq!(absolute(&made), made);
        assert_eq!(absolute(Path::new("")), Path::new(""));
    }

    #[test]
    fn a_temporary_path_is_replaced_by_its_target() {
        let (from, to) = (Path::new("out/.a.partial"), Path::new("out/a"));
        let moved = |path: &str| moved_path(path.into(), from, to);
        assert_eq!(moved("out/.a.partial/b/c"), Path::new("out/a/b/c"));
        assert_eq!(moved("in/b"), Path::new("in/b"));
    }
}
