use std::fs::{self, File, TryLockError};
use std::io::{self, ErrorKind, Read, Write};
use std::path::{Path, PathBuf};

use crate::machine::Machine;
use crate::made_folders::MadeFolders;
use crate::names::temporary_name;
use crate::partial::Partial;
use crate::sync::{folder_of, publish_folder, sync_folder, sync_tree};

/// The extension of a lock file, appended to the partial folder's name.
const LOCK: &str = "lock";

/// A new folder beside its destination, on the same file system. It is written into until it is complete, then renamed by [`Self::commit`].
/// If it is dropped without that, it is removed, so it also serves as a scratch folder.
///
/// Its name is hidden and unique. As long as it exists, a lock file is beside it, of the same name with `.lock` appended, which says on
/// which machine the writer runs. A process that dies leaves both, unlocked: this is how [`Self::remove_leftovers`] recognises them.
#[derive(Debug)]
pub struct PartialFolder {
    folder: PathBuf,
    destination: PathBuf,
    /// Held as long as the folder is to be removed on drop.
    lock: Option<File>,
    /// Parent folders that were made for it.
    made: MadeFolders,
}

impl PartialFolder {
    /// An empty folder beside `destination`. Missing parents are made, and removed again if the folder is not committed. What dead writers
    /// left there is removed first.
    ///
    /// # Errors
    /// The system's error, for instance if the parent folder is not writable.
    pub fn beside(destination: &Path) -> io::Result<Self> {
        let around = folder_of(destination);
        let made = MadeFolders::make(around)?;
        Self::remove_leftovers(around);
        let mut partial = Self::reserve(destination)?;
        partial.made = made;
        fs::create_dir(&partial.folder)?;
        Ok(partial)
    }

    /// A locked name without a folder. The lock comes first: a folder without a lock would look like a leftover.
    fn reserve(destination: &Path) -> io::Result<Self> {
        loop {
            let folder = temporary_name(destination);
            let path = lock_of(&folder);
            let mut lock = File::create_new(&path)?;
            // A file system without locks is no reason to stop: there, no leftover can be locked either, so all of them stay.
            let is_taken = matches!(lock.try_lock(), Err(TryLockError::WouldBlock));
            // Between creating and locking the file, another process may have taken it for a leftover and removed it, or be about to.
            if is_taken || !path.exists() {
                let _ = fs::remove_file(&path);
                continue;
            }
            let written = lock.write_all(Machine::this().to_text().as_bytes());
            // After a power cut the file should say which machine wrote it. If it cannot be synced, it may not.
            let _ = lock.sync_all();
            let partial = Self {
                folder,
                destination: destination.to_owned(),
                lock: Some(lock),
                made: MadeFolders::default(),
            };
            // From here on, dropping `partial` removes the lock file.
            return written.map(|()| partial);
        }
    }

    /// The folder to write into.
    #[must_use]
    pub fn path(&self) -> &Path {
        &self.folder
    }

    /// Syncs the folder with all its content, renames it to its destination and syncs the folders around it. An existing destination that
    /// is not an empty folder stays as it is.
    ///
    /// # Errors
    /// The system's error, for instance [`ErrorKind::DirectoryNotEmpty`]. The destination is then unchanged; only the last step,
    /// syncing the folders around it, may fail with the new folder in place.
    pub fn commit(mut self) -> io::Result<()> {
        publish_folder(&self.folder, &self.destination)?;
        self.made.keep()
    }

    /// As [`Self::commit`], but replaces a folder at the destination: the old one is renamed out of the way and removed once the new one
    /// has its name. A process that dies between the two leaves nothing at the destination, never part of a folder.
    ///
    /// # Errors
    /// As [`Self::commit`]. If the old folder cannot be renamed back, it stays beside the destination, and the error names it.
    pub fn commit_replacing(mut self) -> io::Result<()> {
        sync_tree(&self.folder)?;
        // Dropping `old` removes the folder that is moved there.
        let old = Self::reserve(&self.destination)?;
        if let Err(error) = fs::rename(&self.destination, &old.folder)
            && error.kind() != ErrorKind::NotFound
        {
            return Err(error);
        }
        if let Err(error) = fs::rename(&self.folder, &self.destination) {
            return Err(old.put_back(error));
        }
        sync_folder(folder_of(&self.destination))?;
        self.made.keep()
    }

    /// Renames a folder that was moved away back to its destination, since nothing took its place. Returns the error to report.
    fn put_back(self, error: io::Error) -> io::Error {
        let is_back = fs::rename(&self.folder, &self.destination).is_ok();
        // If another process was quicker, its folder replaces this one.
        if is_back || !self.folder.exists() || self.destination.is_dir() {
            return error;
        }
        let kept = self.keep();
        let message = format!("{error}; the old folder is now {}", kept.display());
        io::Error::new(error.kind(), message)
    }

    /// Syncs files of the folder, renames them in this order into the parent folder, then syncs that: the last file exists only if all do.
    /// Everything else in the folder is removed.
    ///
    /// # Errors
    /// The system's error; [`ErrorKind::AlreadyExists`] if a name is taken. None of the files is then in place, unless the last step,
    /// syncing the folders around them, failed: then all are.
    pub fn commit_files<P: AsRef<Path>>(mut self, names: &[P]) -> io::Result<()> {
        sync_tree(&self.folder)?;
        let around = folder_of(&self.destination);
        for (place, name) in names.iter().enumerate() {
            let (from, to) = (self.folder.join(name), around.join(name));
            let renamed = if to.exists() {
                Err(ErrorKind::AlreadyExists.into())
            } else {
                fs::rename(from, to)
            };
            if let Err(error) = renamed {
                for earlier in &names[..place] {
                    let _ = fs::remove_file(around.join(earlier));
                }
                return Err(error);
            }
        }
        sync_folder(around)?;
        self.made.keep()
    }

    /// Removes the partial folders of dead writers in a folder, whatever their destinations; those still being written are locked and stay.
    /// Call it before checking whether a folder is empty; [`Self::beside`] does so itself.
    ///
    /// On a file system shared by machines, a lock may be visible only on the writer's machine: what another machine's process left or is
    /// writing stays. So does everything on a file system without locks, and what cannot be removed. [`crate::in_the_way()`] reports what
    /// stayed.
    pub fn remove_leftovers(folder: &Path) {
        let here = Machine::this();
        for entry in fs::read_dir(folder).into_iter().flatten().flatten() {
            let path = entry.path();
            let Some(partial) = folder_of_lock(&path) else {
                continue;
            };
            // Opened for writing, since shared file systems do not lock otherwise.
            let Ok(mut lock) = File::options().read(true).write(true).open(&path) else {
                continue;
            };
            let mut text = String::new();
            let is_dead = lock.try_lock().is_ok()
                && lock.read_to_string(&mut text).is_ok()
                && Machine::from_text(&text).is_some_and(|writer| here.sees_locks_of(&writer));
            if is_dead && remove_folder(&partial).is_ok() {
                // Last, and while it is locked: without the lock file, the folder would not be recognised as a leftover.
                let _ = fs::remove_file(&path);
            }
        }
    }

    /// Leaves the folder where it is; nothing removes it: without a lock file it is not a leftover.
    fn keep(mut self) -> PathBuf {
        if let Some(lock) = self.lock.take() {
            let _ = fs::remove_file(lock_of(&self.folder));
            drop(lock);
        }
        std::mem::take(&mut self.folder)
    }

    /// Leaves the folder as a process that dies would. For tests of what happens next.
    #[doc(hidden)]
    pub fn abandon(mut self) {
        self.lock = None;
    }
}

impl Drop for PartialFolder {
    fn drop(&mut self) {
        let Some(lock) = self.lock.take() else {
            return;
        };
        // Best effort: nothing can be done about failures here. After a commit the folder no longer exists.
        if remove_folder(&self.folder).is_ok() {
            let _ = fs::remove_file(lock_of(&self.folder));
        }
        // On NFS, an open file may keep an entry in the parent folder, which is removed next. So close it first.
        drop(lock);
    }
}

fn lock_of(folder: &Path) -> PathBuf {
    let mut path = folder.as_os_str().to_owned();
    path.push(".");
    path.push(LOCK);
    path.into()
}

/// The partial folder whose lock file is `path`.
pub(crate) fn folder_of_lock(path: &Path) -> Option<PathBuf> {
    path.extension().filter(|end| *end == LOCK)?;
    let folder = path.with_extension("");
    Partial::target_of(&folder).is_some().then_some(folder)
}

/// Removes a folder, which may not exist.
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

    /// Leaves what a process leaves that died while writing, on the machine that the lock file names.
    fn leftover(dir: &Path, machine: &str) {
        let folder = dir.join(".drive.17-00ab.partial");
        fs::create_dir_all(folder.join("sub")).unwrap();
        fs::write(folder.join("sub/a"), "half").unwrap();
        fs::write(lock_of(&folder), machine).unwrap();
    }

    fn here() -> String {
        Machine::this().to_text()
    }

    #[test]
    fn a_committed_folder_appears_complete() {
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
        drop(filled(&dir.path().join("all/are/made/drive"), "half"));
        assert!(names(dir.path()).is_empty());
        // Another file in the parent that was made for it stays.
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
    fn leftovers_of_dead_writers_are_removed_and_active_ones_stay() {
        let dir = tempfile::tempdir().unwrap();
        let destination = dir.path().join("drive");
        leftover(dir.path(), &here());
        // Left by a writer that died before it made its folder.
        fs::write(dir.path().join(".other.18-1.partial.lock"), here()).unwrap();
        // No lock belongs to these: a folder without a writer, and a file.
        fs::create_dir(dir.path().join(".drive.17-2.partial")).unwrap();
        fs::write(dir.path().join("package.lock"), "").unwrap();
        let at_work = filled(&destination, "one");
        leftover(dir.path(), &here());
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
        filled(&destination, "half").abandon();
        assert_eq!(names(dir.path()).len(), 5, "{:?}", names(dir.path()));
        PartialFolder::remove_leftovers(dir.path());
        assert_eq!(names(dir.path()).len(), 3, "{:?}", names(dir.path()));
    }

    #[test]
    fn partial_folders_of_another_machine_stay() {
        let dir = tempfile::tempdir().unwrap();
        for other in ["another\n00000000-0000-0000-0000-000000000000\n", "cut off"] {
            leftover(dir.path(), other);
            PartialFolder::remove_leftovers(dir.path());
            assert_eq!(names(dir.path()).len(), 2, "{other}");
        }
    }

    #[test]
    #[cfg(unix)]
    fn a_folder_that_cannot_be_restored_stays_and_is_named() {
        let dir = tempfile::tempdir().unwrap();
        let destination = dir.path().join("drive");
        let old = || {
            let old = filled(&destination, "old");
            (old.path().to_owned(), old)
        };
        let refused = || io::Error::from(ErrorKind::PermissionDenied);
        let (_, back) = old();
        assert_eq!(back.put_back(refused()).to_string(), refused().to_string());
        assert_eq!(content(&destination), "old");
        // Another process was quicker.
        let (aside, replaced) = old();
        replaced.put_back(refused());
        assert!(!aside.exists());
        // A file at the destination is not another process's folder.
        fs::remove_dir_all(&destination).unwrap();
        fs::write(&destination, "x").unwrap();
        let (aside, kept) = old();
        let error = kept.put_back(refused());
        assert_eq!(error.kind(), ErrorKind::PermissionDenied);
        let message = error.to_string();
        assert!(message.contains(aside.to_str().unwrap()), "{message}");
        PartialFolder::remove_leftovers(dir.path());
        assert_eq!(content(&aside), "old");
        assert_eq!(names(dir.path()).len(), 2, "{:?}", names(dir.path()));
    }

    #[test]
    fn files_are_renamed_together() {
        let dir = tempfile::tempdir().unwrap();
        let out = dir.path().join("new/out");
        let made = |content: &str| {
            let partial = filled(&out.join("b"), content);
            for name in ["a", "b"] {
                fs::write(partial.path().join(name), content).unwrap();
            }
            partial
        };
        made("first").commit_files(&["a", "b"]).unwrap();
        assert_eq!(names(&out), ["a", "b"]);
        fs::remove_file(out.join("a")).unwrap();
        // If one name is taken or one file missing, none of the others stays.
        let refused = made("second").commit_files(&["a", "b"]).unwrap_err();
        assert_eq!(refused.kind(), ErrorKind::AlreadyExists);
        made("second").commit_files(&["a", "c"]).unwrap_err();
        assert_eq!(names(&out), ["b"]);
        assert_eq!(fs::read(out.join("b")).unwrap(), b"first");
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
