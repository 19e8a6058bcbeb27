//! A bag's bytes: mapped from a file, or in memory.

use crate::{Error, Result};
use memmap2::{Advice, Mmap};
use std::fs::File;
use std::ops::Deref;
use std::path::{Path, PathBuf};

pub(crate) struct Source {
    /// The file's path, or a name for bytes in memory; for errors.
    pub path: PathBuf,
    bytes: Bytes,
}

enum Bytes {
    Mapped(Mmap),
    Owned(Vec<u8>),
}

impl Source {
    pub(crate) fn map(path: &Path) -> Result<Self> {
        let failed = |source| Error::file(path, source);
        let file = File::open(path).map_err(failed)?;
        let metadata = file.metadata().map_err(failed)?;
        if metadata.is_dir() {
            return Err(failed(std::io::ErrorKind::IsADirectory.into()));
        }
        // An empty mapping is an error on some systems, an empty file is not.
        if metadata.len() == 0 {
            return Ok(Self::memory(path, Vec::new()));
        }
        // SAFETY: the mapping is read-only and private. What remains is memmap2's caveat, stated at `Bag::open`: the file
        // must not be shortened meanwhile (a recorder only appends).
        let map = unsafe { Mmap::map(&file) }.map_err(failed)?;
        // Chunks are read from front to back. This is advice only: a system that ignores it reads as before.
        #[cfg(unix)]
        let _ = map.advise(Advice::Sequential);
        Ok(Self {
            path: path.to_owned(),
            bytes: Bytes::Mapped(map),
        })
    }

    pub(crate) fn memory(name: &Path, bytes: Vec<u8>) -> Self {
        Self {
            path: name.to_owned(),
            bytes: Bytes::Owned(bytes),
        }
    }
}

impl Deref for Source {
    type Target = [u8];

    fn deref(&self) -> &[u8] {
        match &self.bytes {
            Bytes::Mapped(map) => map,
            Bytes::Owned(bytes) => bytes,
        }
    }
}
