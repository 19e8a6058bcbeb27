//! Ensures that only one run at a time works on a shard, or on a whole folder.

use std::fs::{File, TryLockError};
use std::path::Path;
use std::time::Duration;

use super::Shard;
use crate::{Error, Result};

/// Start of the name of a lock file, `.predict-I-of-N.lock`.
const BEGIN: &str = ".predict-";
/// Between a shard and the number of shards.
const OF: &str = "-of-";
/// End of the name.
const END: &str = ".lock";

/// Number of attempts to take a lock that is held.
const TRIES: usize = 3;
/// Pause between two attempts.
const PAUSE: Duration = Duration::from_millis(10);

/// Held while a shard is worked on, so that no other run does. The system releases it when the process ends, however that happens. Its
/// empty file stays: removing it could pull it from under a run that has opened it and is about to lock it.
#[derive(Debug)]
pub struct Lock {
    _file: File,
}

impl Lock {
    /// Takes the lock of a shard.
    ///
    /// # Errors
    /// [`Error::Busy`] if another process holds it; a folder that cannot be written to.
    pub fn take(folder: &Path, shard: Shard) -> Result<Self> {
        let Shard { index, count } = shard;
        let path = folder.join(format!("{BEGIN}{index}{OF}{count}{END}"));
        let file = File::create(&path).map_err(|e| deepfusion_data::Error::file(&path, e))?;
        let mut tries = 1;
        let taken = loop {
            match file.try_lock() {
                // A process that only checks whether the lock is held releases it at once.
                Err(TryLockError::WouldBlock) if tries < TRIES => {
                    tries += 1;
                    std::thread::sleep(PAUSE);
                }
                taken => break taken,
            }
        };
        match taken {
            Ok(()) => {}
            Err(TryLockError::WouldBlock) => {
                let folder = folder.to_owned();
                return Err(Error::Busy { folder, shard });
            }
            // Some network file systems have no locks. Two runs of one shard then both write the same files, each of them complete.
            Err(TryLockError::Error(error)) => {
                tracing::warn!(
                    "{}: cannot be locked ({error}); start each shard only once",
                    path.display()
                );
            }
        }
        Ok(Self { _file: file })
    }

    /// Takes the lock for work on the whole folder, without shards: the lock of the only shard, if no other lock is held.
    ///
    /// # Errors
    /// [`Error::FolderBusy`] if another process holds that lock or one of a shard; a folder that cannot be written to.
    pub fn take_whole(folder: &Path) -> Result<Self> {
        let lock = Self::take(folder, Shard::WHOLE).map_err(|error| match error {
            Error::Busy { folder, .. } => Error::FolderBusy { folder },
            other => other,
        })?;
        if any_of_others(folder, Shard::WHOLE.count, is_surely_held) {
            let folder = folder.to_owned();
            return Err(Error::FolderBusy { folder });
        }
        Ok(lock)
    }

    /// Whether a run in the folder divides the images into a number of shards other than `count`, so that it may be writing any of them.
    /// Also true if this cannot be found out.
    pub(super) fn is_held_by_others(folder: &Path, count: usize) -> bool {
        any_of_others(folder, count, is_held)
    }
}

/// Whether `holds` is true for a lock of a number of shards other than `count`, or the folder cannot be listed.
fn any_of_others(folder: &Path, count: usize, holds: impl Fn(&Path) -> bool) -> bool {
    let Ok(entries) = std::fs::read_dir(folder) else {
        return true;
    };
    entries.flatten().any(|entry| {
        let name = entry.file_name();
        let others = name.to_str().and_then(shards_of_lock);
        others.is_some_and(|others| others != count) && holds(&entry.path())
    })
}

/// The number of shards in a lock file's name.
fn shards_of_lock(name: &str) -> Option<usize> {
    let shard = name.strip_prefix(BEGIN)?.strip_suffix(END)?;
    let (index, count) = shard.split_once(OF)?;
    index.parse::<usize>().ok()?;
    count.parse().ok()
}

fn is_held(lock: &Path) -> bool {
    File::open(lock).is_ok_and(|file| file.try_lock_shared().is_err())
}

/// As `is_held`, but false on a file system without locks: nothing would ever free a folder there.
fn is_surely_held(lock: &Path) -> bool {
    let held = |file: File| matches!(file.try_lock_shared(), Err(TryLockError::WouldBlock));
    File::open(lock).is_ok_and(held)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A run opens the file while another holds the lock, and gets the lock afterwards: a third run must see it held.
    #[test]
    fn a_lock_that_was_waited_for_is_seen_by_others() {
        let folder = tempfile::tempdir().unwrap();
        let first = Lock::take(folder.path(), Shard::WHOLE).unwrap();
        let busy = Lock::take(folder.path(), Shard::WHOLE).unwrap_err();
        assert!(busy.to_string().contains("working on shard 1/1"), "{busy}");
        let file = folder.path().join(".predict-1-of-1.lock");
        let second = File::open(&file).unwrap();
        drop(first);
        second.try_lock().unwrap();
        let third = Lock::take(folder.path(), Shard::WHOLE).unwrap_err();
        assert!(third.to_string().contains("working on shard"), "{third}");
        // Work without shards waits for it, too.
        let whole = Lock::take_whole(folder.path()).unwrap_err();
        assert!(matches!(whole, Error::FolderBusy { .. }), "{whole}");
        drop(second);
        drop(Lock::take(folder.path(), Shard::WHOLE).unwrap());
        Lock::take_whole(folder.path()).unwrap();
    }

    #[test]
    fn locks_of_runs_with_other_shards_are_seen() {
        let folder = tempfile::tempdir().unwrap();
        let at = folder.path();
        let held = |count| Lock::is_held_by_others(at, count);
        std::fs::write(at.join(".predict-a-of-3.lock"), "").unwrap();
        assert!(!held(1));
        let second = Shard { index: 2, count: 2 };
        let lock = Lock::take(at, second).unwrap();
        assert!(held(1) && held(3));
        let whole = Lock::take_whole(at).unwrap_err();
        assert!(matches!(whole, Error::FolderBusy { .. }), "{whole}");
        // Shards of the same number have other images.
        assert!(!held(2));
        drop(lock);
        assert!(!held(1), "the file stays, but the lock is free");
        assert!(Lock::is_held_by_others(&at.join("none"), 1));
    }
}
