//! A folder that one process at a time works in.

use std::fs::{File, TryLockError};
use std::path::Path;

/// Held while a folder is worked in, so that nobody else does. The system frees it with the process, however that ends.
///
/// It is the folder itself that is locked: no file is added to it, and one that is renamed stays locked. Elsewhere than on Unix, where a folder is
/// not opened as a file, nothing is locked.
#[derive(Debug)]
pub struct FolderLock {
    folder: Option<File>,
    /// The process that took it.
    process: u32,
}

impl FolderLock {
    /// Takes the lock of a folder that is there.
    ///
    /// # Errors
    /// [`TryLockError::WouldBlock`] where another has it; else what the system says: some network file systems do not lock folders.
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
    /// The children of a fork hold the same lock: closed here, it would last as long as they do, and closed there, it goes on here.
    fn drop(&mut self) {
        if let Some(folder) = &self.folder
            && self.process == std::process::id()
        {
            // What cannot be unlocked is freed with the last process that has it.
            let _ = folder.unlock();
        }
    }
}
