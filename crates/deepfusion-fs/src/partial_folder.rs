use std::fs::{self, File, TryLockError};
use std::io::{self, ErrorKind};
use std::path::{Path, PathBuf};

use crate::names::temporary_name;
use crate::partial::Partial;
use crate::sync::{folder_of, publish_folder, sync_folder, sync_tree};

/// What the name of a lock's file ends in, after the partial folder's.
const LOCK: &str = "lock";

/// A new folder beside its destination, on the same file system, until it is complete: written into, then renamed by
/// [`Self::commit`]. Dropped without that, it removes itself, so it also serves as a scratch folder.
///
/// Its name is hidden, and no other writer's. As long as it is there a file beside it is locked, of the same name with
/// `.lock` behind it. A process that dies leaves both, without the lock, which is how [`Self::remove_leftovers`] knows them.
#[derive(Debug)]
pub struct PartialFolder {
    folder: PathBuf,
    destination: PathBuf,
    /// The folder around it, where it was made for this one.
    made: Option<PathBuf>,
    _lock: File,
}

impl PartialFolder {
    /// An empty folder beside `destination`, in a folder that is made where there is none, and is removed again if nothing
    /// comes of it. What writers that died left there is removed first.
    ///
    /// # Errors
    /// The system's error, for instance if that folder cannot be written to.
    pub fn beside(destination: &Path) -> io::Result<Self> {
        let around = folder_of(destination);
        let existed = around.is_dir();
        fs::create_dir_all(around)?;
        Self::remove_leftovers(around);
        let mut partial = Self::reserve(destination)?;
        partial.made = (!existed).then(|| around.to_owned());
        fs::create_dir(&partial.folder)?;
        Ok(partial)
    }

    /// A locked name without a folder. The lock comes first: a folder without one could not be told from a leftover.
    fn reserve(destination: &Path) -> io::Result<Self> {
        loop {
            let folder = temporary_name(destination);
            let path = lock_of(&folder);
            let lock = File::create_new(&path)?;
            // A file system without locks is no reason to stop: there nobody can lock a leftover's, either, and all stay.
            let is_taken = matches!(lock.try_lock(), Err(TryLockError::WouldBlock));
            // Between making and locking it, another process may have taken it for a leftover's: then it is, or will be, gone.
            if !is_taken && path.exists() {
                return Ok(Self {
                    folder,
                    destination: destination.to_owned(),
                    made: None,
                    _lock: lock,
                });
            }
        }
    }

    /// The folder to write into.
    #[must_use]
    pub fn path(&self) -> &Path {
        &self.folder
    }

    /// Syncs the folder with all its content, renames it to its destination and syncs the folder around it. A destination that
    /// exists and is not an empty folder stays as it is.
    ///
    /// # Errors
    /// The system's error, for instance [`ErrorKind::DirectoryNotEmpty`]. The destination is then unchanged; only the last step,
    /// syncing the folder around it, may fail with the new folder in place.
    pub fn commit(self) -> io::Result<()> {
        publish_folder(&self.folder, &self.destination)
    }

    /// As [`Self::commit`], in place of a folder that is at the destination: that is renamed out of the way and removed once
    /// the new one has its name. A process that dies between the two leaves nothing at the destination, never half a folder.
    ///
    /// # Errors
    /// As [`Self::commit`].
    pub fn commit_replacing(self) -> io::Result<()> {
        sync_tree(&self.folder)?;
        // Its drop removes what is moved there.
        let old = Self::reserve(&self.destination)?;
        if let Err(error) = fs::rename(&self.destination, &old.folder)
            && error.kind() != ErrorKind::NotFound
        {
            return Err(error);
        }
        if let Err(error) = fs::rename(&self.folder, &self.destination) {
            // Best effort: another process may have been quicker.
            let _ = fs::rename(&old.folder, &self.destination);
            return Err(error);
        }
        sync_folder(folder_of(&self.destination))
    }

    /// Removes the partial folders in a folder whose writers died, whatever their destinations; those that are still written
    /// are locked and stay. For those who ask whether the folder is empty: [`Self::beside`] does it by itself.
    ///
    /// On a file system that machines share, that needs locks which they share, too, as NFS has. Where a file system has no
    /// locks, everything stays. So does what cannot be removed: it is in nobody's way.
    pub fn remove_leftovers(folder: &Path) {
        for entry in fs::read_dir(folder).into_iter().flatten().flatten() {
            let lock = entry.path();
            let partial = lock.with_extension("");
            if lock.extension().is_none_or(|end| end != LOCK)
                || Partial::target_of(&partial).is_none()
            {
                continue;
            }
            // For writing, without which shared file systems do not lock.
            let Ok(file) = File::options().read(true).write(true).open(&lock) else {
                continue;
            };
            if file.try_lock().is_ok() && remove_folder(&partial).is_ok() {
                // Last, and while it is locked: without it nobody would know the folder.
                let _ = fs::remove_file(&lock);
            }
        }
    }
}

impl Drop for PartialFolder {
    fn drop(&mut self) {
        // Best effort: nothing can be done about failures here. After a commit there is no such folder, and the one around it
        // is not empty.
        if remove_folder(&self.folder).is_ok() {
            let _ = fs::remove_file(lock_of(&self.folder));
        }
        if let Some(made) = &self.made {
            let _ = fs::remove_dir(made);
        }
    }
}

fn lock_of(folder: &Path) -> PathBuf {
    let mut path = folder.as_os_str().to_owned();
    path.push(".");
    path.push(LOCK);
    path.into()
}

/// Removes a folder, which may not be there.
fn remove_folder(folder: &Path) -> io::Result<()> {
    match fs::remove_dir_all(folder) {
        Err(error) if error.kind() == ErrorKind::NotFound => Ok(()),
        removed => removed,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn names(dir: &Path) -> Vec<String> {
        let entries = fs::read_dir(dir).unwrap();
        let mut names: Vec<String> = entries
            .map(|e| e.unwrap().file_name().into_string().unwrap())
            .collect();
        names.sort();
        names
    }

    /// A partial folder with a file in it.
    fn filled(destination: &Path, content: &str) -> PartialFolder {
        let partial = PartialFolder::beside(destination).unwrap();
        fs::create_dir(partial.path().join("sub")).unwrap();
        fs::write(partial.path().join("sub/a"), content).unwrap();
        partial
    }

    fn content(destination: &Path) -> String {
        fs::read_to_string(destination.join("sub/a")).unwrap()
    }

    /// What a process leaves that died while it wrote.
    fn leftover(dir: &Path) {
        let folder = dir.join(".drive.17-00ab.partial");
        fs::create_dir_all(folder.join("sub")).unwrap();
        fs::write(folder.join("sub/a"), "half").unwrap();
        fs::write(lock_of(&folder), "").unwrap();
    }

    #[test]
    fn a_committed_folder_appears_whole() {
        let dir = tempfile::tempdir().unwrap();
        let destination = dir.path().join("made/drive");
        let partial = filled(&destination, "whole");
        assert!(!destination.exists());
        assert_eq!(Partial::target_of(partial.path()), Some("drive"));
        partial.commit().unwrap();
        assert_eq!(content(&destination), "whole");
        assert_eq!(names(&dir.path().join("made")), ["drive"]);
    }

    #[test]
    fn a_dropped_folder_leaves_nothing() {
        let dir = tempfile::tempdir().unwrap();
        drop(filled(&dir.path().join("drive"), "half"));
        drop(filled(&dir.path().join("made/drive"), "half"));
        assert!(names(dir.path()).is_empty());
        // What else came into the folder that was made for it stays.
        let partial = filled(&dir.path().join("made/drive"), "half");
        fs::write(dir.path().join("made/other"), "x").unwrap();
        drop(partial);
        assert_eq!(names(&dir.path().join("made")), ["other"]);
    }

    #[test]
    fn a_destination_that_exists_is_refused_or_replaced() {
        let dir = tempfile::tempdir().unwrap();
        let destination = dir.path().join("drive");
        fs::create_dir(&destination).unwrap();
        filled(&destination, "first").commit().unwrap();
        filled(&destination, "second").commit().unwrap_err();
        assert_eq!(content(&destination), "first");
        filled(&destination, "third").commit_replacing().unwrap();
        assert_eq!(content(&destination), "third");
        assert_eq!(names(dir.path()), ["drive"]);
        let new = dir.path().join("new");
        filled(&new, "fourth").commit_replacing().unwrap();
        assert_eq!(content(&new), "fourth");
        assert_eq!(names(dir.path()), ["drive", "new"]);
    }

    #[test]
    fn what_a_dead_writer_left_goes_and_what_another_writes_stays() {
        let dir = tempfile::tempdir().unwrap();
        let destination = dir.path().join("drive");
        leftover(dir.path());
        // Of one that died before it made its folder.
        fs::write(dir.path().join(".other.18-1.partial.lock"), "").unwrap();
        // Nobody's, or a file's: no lock is theirs.
        fs::create_dir(dir.path().join(".drive.17-2.partial")).unwrap();
        fs::write(dir.path().join("package.lock"), "").unwrap();
        let at_work = filled(&destination, "one");
        leftover(dir.path());
        let beside_it = filled(&destination, "another");
        assert_ne!(at_work.path(), beside_it.path());
        PartialFolder::remove_leftovers(dir.path());
        drop(beside_it);
        assert_eq!(names(dir.path()).len(), 4, "{:?}", names(dir.path()));
        at_work.commit().unwrap();
        assert_eq!(content(&destination), "one");
        assert_eq!(
            names(dir.path()),
            [".drive.17-2.partial", "drive", "package.lock"]
        );
        PartialFolder::remove_leftovers(&dir.path().join("none"));
    }

    #[test]
    fn many_writers_of_one_destination_do_not_disturb_each_other() {
        let dir = tempfile::tempdir().unwrap();
        let destination = &dir.path().join("drive");
        let committed: usize = std::thread::scope(|scope| {
            let writers: Vec<_> = (0..8)
                .map(|n| {
                    scope.spawn(move || {
                        let partial = filled(destination, &n.to_string());
                        usize::from(partial.commit().is_ok())
                    })
                })
                .collect();
            writers.into_iter().map(|w| w.join().unwrap()).sum()
        });
        assert_eq!(committed, 1);
        assert_eq!(names(dir.path()), ["drive"]);
    }
}
