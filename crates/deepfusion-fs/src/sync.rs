use std::fs::File;
use std::io::{self, ErrorKind};
use std::path::Path;
use std::sync::atomic::{AtomicUsize, Ordering};

/// Syncs a finished file, renames it to `target` and syncs the folder: once this returns, the target is durable.
///
/// # Errors
/// The system's error. If syncing or renaming the file failed, the target is unchanged.
pub fn publish(file: &Path, target: &Path) -> io::Result<()> {
    sync_file(file)?;
    std::fs::rename(file, target)?;
    sync_folder(folder_of(target))
}

/// Syncs a finished folder with all its content, renames it to `target` and syncs the parent folder. Fails if `target`
/// exists and is not an empty folder.
///
/// # Errors
/// The system's error.
pub fn publish_folder(folder: &Path, target: &Path) -> io::Result<()> {
    sync_tree(folder)?;
    // Except on Unix, even an empty folder would block the rename; one that is not empty stays.
    let _ = std::fs::remove_dir(target);
    std::fs::rename(folder, target)?;
    sync_folder(folder_of(target))
}

/// Number of threads that sync at once, so that the disk can combine their writes.
const WAITING: usize = 8;

/// Waits until the content of files is on the disk. Their names need [`sync_folder`].
///
/// # Errors
/// The system's error for one of the files that failed.
pub fn sync_files<P: AsRef<Path>>(files: impl IntoIterator<Item = P>) -> io::Result<()> {
    let files: Vec<P> = files.into_iter().collect();
    let files: Vec<&Path> = files.iter().map(AsRef::as_ref).collect();
    if let [file] = files.as_slice() {
        return sync_file(file);
    }
    let next = AtomicUsize::new(0);
    let sync_some = || -> io::Result<()> {
        while let Some(file) = files.get(next.fetch_add(1, Ordering::Relaxed)) {
            sync_file(file)?;
        }
        Ok(())
    };
    std::thread::scope(|scope| {
        let threads: Vec<_> = (0..files.len().min(WAITING))
            .map(|_| scope.spawn(sync_some))
            .collect();
        threads.into_iter().try_for_each(|thread| {
            let outcome = thread.join();
            outcome.unwrap_or_else(|panic| std::panic::resume_unwind(panic))
        })
    })
}

/// Waits until the names in a folder, though not its files' content, are on the disk.
///
/// # Errors
/// The system's error. A file system that cannot sync folders is not an error: nothing more can be done.
pub fn sync_folder(folder: &Path) -> io::Result<()> {
    // Except on Unix, a folder cannot be opened as a file, and its names are journalled.
    if !cfg!(unix) {
        return Ok(());
    }
    match File::open(folder)?.sync_all() {
        Err(error)
            if matches!(
                error.kind(),
                ErrorKind::InvalidInput | ErrorKind::Unsupported
            ) =>
        {
            Ok(())
        }
        synced => synced,
    }
}

/// Syncs all files and folders below a folder.
///
/// # Errors
/// The system's error for the first that failed.
pub(crate) fn sync_tree(folder: &Path) -> io::Result<()> {
    let mut files = Vec::new();
    for entry in std::fs::read_dir(folder)? {
        let entry = entry?;
        // Links are not followed: what they point to was not made here.
        let kind = entry.file_type()?;
        if kind.is_dir() {
            sync_tree(&entry.path())?;
        } else if kind.is_file() {
            files.push(entry.path());
        }
    }
    sync_files(files)?;
    sync_folder(folder)
}

fn sync_file(file: &Path) -> io::Result<()> {
    // Windows syncs only files that are open for writing.
    File::options()
        .read(true)
        .write(cfg!(windows))
        .open(file)?
        .sync_all()
}

/// The folder that a path is in.
pub(crate) fn folder_of(path: &Path) -> &Path {
    match path.parent() {
        Some(folder) if folder != Path::new("") => folder,
        _ => Path::new("."),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_folder_appears_with_all_its_content() {
        let dir = tempfile::tempdir().unwrap();
        let (aside, target) = (dir.path().join(".aside"), dir.path().join("drive"));
        std::fs::create_dir_all(aside.join("a/b")).unwrap();
        std::fs::write(aside.join("a/b/c"), "x").unwrap();
        publish_folder(&aside, &target).unwrap();
        assert_eq!(std::fs::read(target.join("a/b/c")).unwrap(), b"x");
        assert!(!aside.exists());
    }

    #[test]
    fn a_missing_file_cannot_be_synced() {
        let dir = tempfile::tempdir().unwrap();
        let none = dir.path().join("none");
        assert!(sync_files([&none]).is_err());
        let there = dir.path().join("there");
        std::fs::write(&there, "x").unwrap();
        let mut many = vec![&there; 20];
        sync_files(&many).unwrap();
        many.push(&none);
        assert!(sync_files(&many).is_err());
        assert!(sync_folder(&none).is_err());
        assert!(publish(&none, &dir.path().join("target")).is_err());
        assert!(!dir.path().join("target").exists());
    }
}
