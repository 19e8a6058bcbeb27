use std::path::{Path, PathBuf};

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
