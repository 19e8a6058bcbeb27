//! Folders that are made for an output, and removed if nothing is written into them.

use std::fs;
use std::io;
use std::path::{Path, PathBuf};

use crate::sync::{folder_of, sync_folder};

/// Folders that were made, innermost first. When dropped, it removes the empty ones, unless they were [kept](Self::keep).
#[derive(Debug, Default)]
pub(crate) struct MadeFolders(Vec<PathBuf>);

impl MadeFolders {
    /// Makes a folder and its missing parents.
    pub(crate) fn make(folder: &Path) -> io::Result<Self> {
        let missing: Vec<&Path> = folder
            .ancestors()
            .take_while(|around| !around.as_os_str().is_empty() && !around.exists())
            .collect();
        // Filled one by one: if a folder cannot be made, those made before it are removed. Existing ones stay.
        let mut made = Self::default();
        for around in missing.into_iter().rev() {
            match fs::create_dir(around) {
                Ok(()) => made.0.insert(0, around.to_owned()),
                // Another process was quicker, or the folder exists by way of `..`.
                Err(_) if around.is_dir() => {}
                Err(error) => return Err(error),
            }
        }
        // Fails with the right error if a file is in its place.
        fs::create_dir_all(folder)?;
        Ok(made)
    }

    /// Keeps the folders. When this returns, their names are on the disk.
    pub(crate) fn keep(&mut self) -> io::Result<()> {
        std::mem::take(&mut self.0)
            .iter()
            .try_for_each(|made| sync_folder(folder_of(made)))
    }
}

impl Drop for MadeFolders {
    fn drop(&mut self) {
        for made in &self.0 {
            // Fails if the folder is not empty, as intended.
            let _ = fs::remove_dir(made);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn made_folders_are_removed_unless_kept() {
        let dir = tempfile::tempdir().unwrap();
        let there = dir.path().join("there");
        fs::create_dir(&there).unwrap();
        let folder = there.join("a/b/c");
        let made = MadeFolders::make(&folder).unwrap();
        assert!(folder.is_dir());
        drop(made);
        assert!(there.is_dir() && !there.join("a").exists());
        let made = MadeFolders::make(&folder).unwrap();
        fs::write(there.join("a/x"), "x").unwrap();
        drop(made);
        assert!(there.join("a/x").exists() && !there.join("a/b").exists());
        // It exists already, but is only visible once `a` is made.
        drop(MadeFolders::make(&there.join("new/../../there")).unwrap());
        assert!(there.is_dir());
        let mut made = MadeFolders::make(&folder).unwrap();
        made.keep().unwrap();
        drop(made);
        assert!(folder.is_dir());
        // A folder that existed before is not removed.
        drop(MadeFolders::make(&folder).unwrap());
        assert!(folder.is_dir());
    }

    #[test]
    fn a_failure_leaves_no_folders() {
        let dir = tempfile::tempdir().unwrap();
        let file = dir.path().join("file");
        fs::write(&file, "x").unwrap();
        MadeFolders::make(&file.join("a/b")).unwrap_err();
        assert_eq!(fs::read(&file).unwrap(), b"x");
    }
}
