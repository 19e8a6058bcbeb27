use std::borrow::Cow;
use std::collections::BTreeSet;
use std::fs::File;
use std::io::{self, BufWriter, Write};
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicBool, Ordering};

use crate::names::{shortened, temporary_name};
use crate::sync::{folder_of, publish, sync_files, sync_folder};

/// A temporary file beside its target, on the same file system, until it is complete. It is removed on drop, unless it was published or
/// [kept](Self::keep).
#[derive(Debug)]
pub struct Partial {
    temporary: PathBuf,
    target: PathBuf,
    /// Whether the temporary name is known to readers, so that an earlier writer may have left a file there.
    watched: bool,
    /// Whether drop removes the file with the temporary name; false if another writer made it.
    ours: AtomicBool,
}

impl Partial {
    /// A temporary name for the file at `target`. Nothing is created yet.
    #[must_use]
    pub fn beside(target: &Path) -> Self {
        Self {
            temporary: temporary_name(target),
            target: target.to_owned(),
            watched: false,
            ours: AtomicBool::new(true),
        }
    }

    /// The target's name with `.partial` appended, for a file that readers watch while it grows. Only one writer at a time may use it; a
    /// file left by a killed writer is replaced. Nothing is created yet.
    #[must_use]
    pub fn watched(target: &Path) -> Self {
        let mut name = target.file_name().unwrap_or_default().to_owned();
        name.push(".partial");
        Self {
            temporary: target.with_file_name(name),
            target: target.to_owned(),
            watched: true,
            ours: AtomicBool::new(false),
        }
    }

    /// The path to write to.
    #[must_use]
    pub fn path(&self) -> &Path {
        &self.temporary
    }

    /// Creates the file, empty.
    ///
    /// # Errors
    /// The system's error, for instance if there is no such folder.
    pub fn create(&self) -> io::Result<File> {
        let file = if self.watched {
            File::create(&self.temporary)?
        } else {
            File::create_new(&self.temporary)?
        };
        self.ours.store(true, Ordering::Relaxed);
        Ok(file)
    }

    /// From now on the file stays even if it is not published: a part of it is better than nothing.
    pub fn keep(&self) {
        self.ours.store(false, Ordering::Relaxed);
    }

    /// Syncs the content, renames the file to its target and syncs the folder.
    ///
    /// # Errors
    /// The system's error. If syncing the file or renaming failed, the target is unchanged.
    pub fn publish(self) -> io::Result<()> {
        publish(&self.temporary, &self.target)?;
        // The next writer's file may already have the temporary name.
        self.keep();
        Ok(())
    }

    /// Renames the file to its target without waiting for the disk: after a power cut its content may be missing.
    ///
    /// # Errors
    /// The system's error; the target is then unchanged.
    pub fn publish_unsynced(self) -> io::Result<()> {
        std::fs::rename(&self.temporary, &self.target)
    }

    /// The target's name ([possibly cut](Self::name_of)), if `path` is a temporary file or folder that a killed program left behind.
    #[must_use]
    pub fn target_of(path: &Path) -> Option<&str> {
        let name = path.file_name()?.to_str()?;
        let inner = name.strip_prefix('.')?.strip_suffix(".partial")?;
        let (file, process) = inner.rsplit_once('.')?;
        process.contains('-').then_some(file)
    }

    /// What [`Self::target_of`] returns for this target: a long name is cut, so that the temporary name does not exceed the limit of file
    /// systems.
    #[must_use]
    pub fn name_of(target: &str) -> Cow<'_, str> {
        shortened(target)
    }
}

impl Drop for Partial {
    fn drop(&mut self) {
        if *self.ours.get_mut() {
            // Nothing can be done about failures here.
            let _ = std::fs::remove_file(&self.temporary);
        }
    }
}

/// Writes a temporary file, syncs it, renames it to `path` and syncs the folder: `path` is never a part of a file, even after a power cut,
/// and is durable once this returns. `failed` converts the system's error into the caller's.
///
/// # Errors
/// The error of `write`, or `failed` of the system's error. The temporary file is then removed and `path` is unchanged; only if the last
/// step, syncing the folder, fails is the new file in place.
pub fn write_atomically<E>(
    path: &Path,
    failed: impl Fn(io::Error) -> E,
    write: impl FnOnce(&mut BufWriter<File>) -> Result<(), E>,
) -> Result<(), E> {
    write_aside(path, &failed, write)?.publish().map_err(failed)
}

/// [`write_atomically`] for bytes already in memory.
///
/// # Errors
/// The system's error; the temporary file is then removed.
pub fn write(path: &Path, bytes: impl AsRef<[u8]>) -> io::Result<()> {
    write_atomically(path, |e| e, |out| out.write_all(bytes.as_ref()))
}

/// [`write_atomically`] without waiting for the disk: a reader never sees part of a file, but a power cut may leave one. For many files
/// whose completion is recorded by another file, written after [`crate::sync_files`].
///
/// # Errors
/// As [`write_atomically`].
pub fn write_unsynced<E>(
    path: &Path,
    failed: impl Fn(io::Error) -> E,
    write: impl FnOnce(&mut BufWriter<File>) -> Result<(), E>,
) -> Result<(), E> {
    write_aside(path, &failed, write)?
        .publish_unsynced()
        .map_err(failed)
}

/// Writes a temporary file, for [`publish_all`] or [`Partial::publish`].
///
/// # Errors
/// The error of `write`, or `failed` of the system's error. The temporary file is then removed.
pub fn write_aside<E>(
    path: &Path,
    failed: impl Fn(io::Error) -> E,
    write: impl FnOnce(&mut BufWriter<File>) -> Result<(), E>,
) -> Result<Partial, E> {
    let partial = Partial::beside(path);
    let mut out = BufWriter::new(partial.create().map_err(&failed)?);
    write(&mut out)?;
    out.flush().map_err(&failed)?;
    Ok(partial)
}

/// Publishes many files at once: waiting for the disk takes hardly longer than for one.
///
/// # Errors
/// The system's error. If syncing failed, no target was changed; if renaming failed, the targets before that one are in place.
pub fn publish_all(partials: Vec<Partial>) -> io::Result<()> {
    sync_files(partials.iter().map(Partial::path))?;
    let mut folders = BTreeSet::new();
    for partial in partials {
        folders.insert(folder_of(&partial.target).to_owned());
        partial.publish_unsynced()?;
    }
    folders.iter().try_for_each(|folder| sync_folder(folder))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn names(dir: &Path) -> Vec<String> {
        let entries = std::fs::read_dir(dir).unwrap();
        entries
            .map(|e| e.unwrap().file_name().into_string().unwrap())
            .collect()
    }

    #[test]
    fn the_file_appears_complete() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("a.txt");
        type Write = fn(&Path) -> io::Result<()>;
        fn fill(path: &Path, out: &mut BufWriter<File>) -> io::Result<()> {
            out.write_all(b"new content")?;
            out.flush()?;
            assert_eq!(std::fs::read_to_string(path).unwrap(), "old");
            Ok(())
        }
        let synced: Write = |path| write_atomically(path, |e| e, |out| fill(path, out));
        let unsynced: Write = |path| write_unsynced(path, |e| e, |out| fill(path, out));
        for write in [synced, unsynced] {
            std::fs::write(&path, "old").unwrap();
            write(&path).unwrap();
            assert_eq!(std::fs::read_to_string(&path).unwrap(), "new content");
            assert_eq!(names(dir.path()), ["a.txt"]);
        }
    }

    #[test]
    fn a_failure_leaves_nothing_behind() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("a.txt");
        let error = write_atomically(
            &path,
            |e| e,
            |out| {
                out.write_all(b"half")?;
                Err(io::Error::other("out of ideas"))
            },
        )
        .unwrap_err();
        assert!(error.to_string().contains("out of ideas"));
        assert!(names(dir.path()).is_empty());
        // A folder is in the way: the rename fails, and the temporary file is removed.
        std::fs::create_dir(&path).unwrap();
        std::fs::write(path.join("x"), "x").unwrap();
        write_atomically(&path, |e| e, |out| out.write_all(b"whole")).unwrap_err();
        assert_eq!(names(dir.path()), ["a.txt"]);
    }

    #[test]
    fn a_missing_folder_is_an_error() {
        let path = Path::new("no/such/folder/a.txt");
        let error = write_atomically(path, |e| e, |_| Ok(())).unwrap_err();
        assert_eq!(error.kind(), io::ErrorKind::NotFound);
    }

    /// The path of a file in the current folder names no folder; that folder must still be synced.
    #[test]
    fn a_bare_name_is_in_the_current_folder() {
        let path = PathBuf::from(format!("bare-name-{}.txt", std::process::id()));
        write_atomically(&path, |e| e, |out| out.write_all(b"x")).unwrap();
        assert_eq!(std::fs::read(&path).unwrap(), b"x");
        std::fs::remove_file(&path).unwrap();
    }

    #[test]
    fn files_are_published_together_or_removed() {
        let dir = tempfile::tempdir().unwrap();
        std::fs::create_dir(dir.path().join("sub")).unwrap();
        let aside = |name: &str| {
            let path = dir.path().join(name);
            write_aside(&path, |e| e, |out| out.write_all(name.as_bytes())).unwrap()
        };
        publish_all(vec![aside("a"), aside("sub/b"), aside("c")]).unwrap();
        for name in ["a", "sub/b", "c"] {
            let content = std::fs::read(dir.path().join(name)).unwrap();
            assert_eq!(content, name.as_bytes());
        }
        // If one file is missing, none of the others is renamed.
        let gone = aside("d");
        std::fs::remove_file(gone.path()).unwrap();
        publish_all(vec![aside("e"), gone]).unwrap_err();
        let mut left = names(dir.path());
        left.sort();
        assert_eq!(left, ["a", "c", "sub"]);
        publish_all(Vec::new()).unwrap();
    }

    /// What a killed program left behind must not block the next one, whatever its process id.
    #[test]
    fn temporary_names_of_a_process_are_unique() {
        let target = Path::new("out/a_depth.png");
        let (a, b) = (Partial::beside(target), Partial::beside(target));
        assert_ne!(a.path(), b.path());
        assert_eq!(Partial::target_of(a.path()), Some("a_depth.png"));
        assert_eq!(Partial::target_of(target), None);
        let older = Path::new("out/.a_depth.png.17-3.partial");
        assert_eq!(Partial::target_of(older), Some("a_depth.png"));
        assert_eq!(Partial::target_of(Path::new("out/.a.partial")), None);
        let long = "a".repeat(255);
        let a = Partial::beside(&Path::new("out").join(&long));
        assert_eq!(
            Partial::target_of(a.path()),
            Some(&*Partial::name_of(&long))
        );
    }

    #[test]
    fn a_watched_file_grows_under_a_known_name() {
        let dir = tempfile::tempdir().unwrap();
        let (target, known) = (
            dir.path().join("a.jsonl"),
            dir.path().join("a.jsonl.partial"),
        );
        std::fs::write(&known, "of a writer that was killed").unwrap();
        let partial = Partial::watched(&target);
        let mut file = partial.create().unwrap();
        file.write_all(b"new").unwrap();
        drop(file);
        assert_eq!(partial.path(), known);
        assert_eq!(std::fs::read(&known).unwrap(), b"new");
        assert!(!target.exists());
        partial.publish().unwrap();
        assert_eq!(names(dir.path()), ["a.jsonl"]);
        // An abandoned file is removed, unless it was kept; the earlier target stays.
        let partial = Partial::watched(&target);
        drop(partial.create().unwrap());
        drop(partial);
        assert_eq!(names(dir.path()), ["a.jsonl"]);
        assert_eq!(std::fs::read(&target).unwrap(), b"new");
        let partial = Partial::watched(&target);
        drop(partial.create().unwrap());
        partial.keep();
        drop(partial);
        assert!(known.exists());
        // Another writer's file, when this one created nothing.
        drop(Partial::watched(&target));
        assert!(known.exists());
    }
}
