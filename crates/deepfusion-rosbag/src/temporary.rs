//! A file under another name until it is whole.

use std::ffi::OsString;
use std::io;
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicU64, Ordering};

/// A file's name beside its target; the file is removed when this goes out of scope, unless it was renamed.
pub(crate) struct Temporary(PathBuf);

impl Temporary {
    pub fn beside(path: &Path) -> Self {
        // Two threads, or two processes, may write the same path: the last rename wins, whole.
        static COUNT: AtomicU64 = AtomicU64::new(0);
        let count = COUNT.fetch_add(1, Ordering::Relaxed);
        let mut name = OsString::from(".");
        name.push(path.file_name().unwrap_or_default());
        name.push(format!(".{}-{count}.partial", std::process::id()));
        Self(path.with_file_name(name))
    }

    pub fn path(&self) -> &Path {
        &self.0
    }

    pub fn rename_to(self, path: &Path) -> io::Result<()> {
        std::fs::rename(&self.0, path)
    }
}

impl Drop for Temporary {
    fn drop(&mut self) {
        // Gone already after the rename; nothing can be done about other failures here.
        let _ = std::fs::remove_file(&self.0);
    }
}
