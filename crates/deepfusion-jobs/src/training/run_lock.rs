//! Ensures that only one process at a time writes to the folder of a run, or of a table of runs.

use std::fs::TryLockError;
use std::path::Path;

use deepfusion_fs::FolderLock;

use crate::{Error, Result};

/// Held while a run's folder is written to; of several workers, the first one holds it.
#[derive(Debug)]
pub struct RunLock {
    _lock: Option<FolderLock>,
}

impl RunLock {
    /// Takes the lock of an existing folder. If it cannot be locked, that is a warning ([`tracing::warn`]).
    ///
    /// # Errors
    /// [`Error::RunBusy`] if another process holds it.
    pub fn take(folder: &Path) -> Result<Self> {
        let lock = match FolderLock::take(folder) {
            Ok(lock) => Some(lock),
            Err(TryLockError::WouldBlock) => {
                let folder = folder.to_owned();
                return Err(Error::RunBusy { folder });
            }
            Err(TryLockError::Error(error)) => {
                tracing::warn!(
                    "{}: cannot be locked ({error}); let only one process at a time write to it",
                    folder.display()
                );
                None
            }
        };
        Ok(Self { _lock: lock })
    }
}

#[cfg(all(test, unix))]
mod tests {
    use super::*;
    use deepfusion_hint::Hint as _;
    use std::fs;

    #[test]
    fn a_folder_is_locked_until_the_lock_is_dropped() {
        let at = tempfile::tempdir().unwrap();
        let (run, renamed) = (at.path().join("run"), at.path().join("renamed"));
        fs::create_dir(&run).unwrap();
        let lock = RunLock::take(&run).unwrap();
        let error = RunLock::take(&run).unwrap_err();
        assert!(error.to_string().contains("another process"), "{error}");
        assert!(error.hint().unwrap().contains("wait"));
        // No lock file blocks others, and the lock moves with the folder.
        assert_eq!(fs::read_dir(&run).unwrap().count(), 0);
        fs::rename(&run, &renamed).unwrap();
        let error = RunLock::take(&renamed).unwrap_err();
        assert!(matches!(error, Error::RunBusy { .. }), "{error}");
        fs::create_dir(&run).unwrap();
        RunLock::take(&run).unwrap();
        drop(lock);
        RunLock::take(&renamed).unwrap();
    }
}
