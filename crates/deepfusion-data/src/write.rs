use crate::Error;
use std::fs::File;
use std::io::{BufWriter, Write};
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicU64, Ordering};

/// Writes a file under a temporary name beside `path` and renames it once it is complete, so that
/// `path` never holds half a file: a reader sees the old content or the new one.
///
/// # Errors
/// What `write` returns, or [`Error::File`] / [`Error::NoSuchPath`] (the folder does not exist) naming
/// `path`. The temporary file is then gone and `path` is as it was.
pub fn write_atomically<E: From<Error>>(
    path: &Path,
    write: impl FnOnce(&mut BufWriter<File>) -> Result<(), E>,
) -> Result<(), E> {
    let temporary = Temporary::beside(path);
    let failed = |source| E::from(Error::file(path, source));
    let mut out = BufWriter::new(File::create_new(&temporary.0).map_err(failed)?);
    write(&mut out)?;
    out.flush().map_err(failed)?;
    drop(out);
    std::fs::rename(&temporary.0, path).map_err(failed)
}

/// A file that is removed when it goes out of scope; after the rename nothing bears its name.
struct Temporary(PathBuf);

impl Temporary {
    fn beside(path: &Path) -> Self {
        // Two threads, or two processes, may write the same path: the last rename wins, whole.
        static COUNT: AtomicU64 = AtomicU64::new(0);
        let mut name = std::ffi::OsString::from(".");
        name.push(path.file_name().unwrap_or_default());
        name.push(format!(
            ".{}-{}.partial",
            std::process::id(),
            COUNT.fetch_add(1, Ordering::Relaxed)
        ));
        Self(path.with_file_name(name))
    }
}

impl Drop for Temporary {
    fn drop(&mut self) {
        // Gone already after the rename; nothing can be done about other failures here.
        let _ = std::fs::remove_file(&self.0);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::io;

    fn names(dir: &Path) -> Vec<String> {
        let entries = std::fs::read_dir(dir).unwrap();
        entries
            .map(|e| e.unwrap().file_name().into_string().unwrap())
            .collect()
    }

    #[test]
    fn the_file_appears_whole() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("a.txt");
        std::fs::write(&path, "old").unwrap();
        write_atomically(&path, |out| {
            out.write_all(b"new content")
                .map_err(|e| Error::file(&path, e))?;
            out.flush().map_err(|e| Error::file(&path, e))?;
            assert_eq!(std::fs::read_to_string(&path).unwrap(), "old");
            Ok::<(), Error>(())
        })
        .unwrap();
        assert_eq!(std::fs::read_to_string(&path).unwrap(), "new content");
        assert_eq!(names(dir.path()), ["a.txt"]);
    }

    #[test]
    fn a_failure_leaves_nothing_behind() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("a.txt");
        let error = write_atomically(&path, |out| {
            out.write_all(b"half").map_err(|e| Error::file(&path, e))?;
            Err(Error::file(&path, io::Error::other("out of ideas")))
        })
        .unwrap_err();
        assert!(error.to_string().contains("out of ideas"));
        assert!(names(dir.path()).is_empty());
    }

    #[test]
    fn a_missing_folder_is_named() {
        let error = write_atomically(Path::new("no/such/folder/a.txt"), |_| Ok::<(), Error>(()));
        let message = error.unwrap_err().to_string();
        assert!(message.contains("no/such/folder/a.txt"), "{message}");
    }

    #[test]
    #[cfg(target_os = "linux")]
    fn a_full_disk_is_an_error_with_a_hint() {
        // /dev/full takes no byte; a rename onto it is not reached.
        let mut out = BufWriter::new(File::options().write(true).open("/dev/full").unwrap());
        out.write_all(b"x").unwrap();
        let error = Error::file(Path::new("depth.npz"), out.flush().unwrap_err());
        assert!(error.hint().unwrap().contains("full"), "{error}");
    }
}
