//! A lock on a folder that only one process may work in.

use std::fs::{File, TryLockError};
use std::path::Path;

/// A lock on a folder: while it is held, no other process works in it. The system releases it when the process ends, however that happens.
///
/// The folder itself is locked: no file is added to it, and it stays locked if it is renamed. Except on Unix, a folder cannot be opened as
/// a file, and nothing is locked.
#[derive(Debug)]
pub struct FolderLock {
    folder: Option<File>,
    /// Id of the process that took the lock.
    process: u32,
}

impl FolderLock {
    /// Takes the lock of an existing folder.
    ///
    /// # Errors
    /// [`TryLockError::WouldBlock`] if another process holds it; otherwise the system's error: some network file systems do not lock
    /// folders.
    pub fn take(folder: &Path) -> Result<Self, TryLockError> {
        if !cfg!(unix) {
            return Ok(Self::of(None));
        }
        let folder = File::open(folder).map_err(TryLockError::Error)?;
        folder.try_lock()?;
        Ok(Self::of(Some(folder)))
    }

    fn of(folder: Option<File>) -> Self {
        Self {
            folder,
            process: std::process::id(),
        }
    }
}

impl Drop for FolderLock {
    /// Unlocks explicitly, and only in the process that took the lock. Forked children share it: if the parent only closed its file, the
    /// lock would last until they end, and a child that unlocked it would release the parent's.
    fn drop(&mut self) {
        if let Some(folder) = &self.folder
            && self.process == std::process::id()
        {
            // If it cannot be unlocked, the last process that has the file open releases it.
            let _ = folder.unlock();
        }
    }
}
