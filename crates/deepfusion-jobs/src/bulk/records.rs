//! Targets on the disk: a JSON file for each frame, and one file with a line for each frame.

use std::fs::File;
use std::io::{BufWriter, Write};
use std::path::{Path, PathBuf};

use deepfusion_data::Error as DataError;
use deepfusion_fs::Partial;
use deepfusion_records::FrameRecord;

use crate::Result;

/// Path of a frame's record.
#[must_use]
pub fn record_path(folder: &Path, name: &str) -> PathBuf {
    folder.join(format!("{name}_targets.json"))
}

/// Path of the file with all frames' records, one per line.
#[must_use]
pub fn record_lines_path(folder: &Path) -> PathBuf {
    folder.join("targets.jsonl")
}

/// A frame's record as one line.
///
/// # Errors
/// A number that JSON cannot represent.
pub fn record_line(record: &FrameRecord) -> Result<String> {
    Ok(serde_json::to_string(record)? + "\n")
}

/// Writes a frame's record as its own file.
///
/// # Errors
/// A file that cannot be written.
pub fn write_record(record: &FrameRecord, path: &Path) -> Result<()> {
    let text = serde_json::to_string_pretty(record)? + "\n";
    let failed = |e| DataError::file(path, e);
    deepfusion_fs::write_unsynced(path, failed, |out| {
        out.write_all(text.as_bytes()).map_err(failed)
    })?;
    Ok(())
}

/// A file with one line per frame, which grows beside its final path under a name that readers can watch. If it is not finished, its lines
/// stay there; without any line, it is removed.
pub struct RecordLines {
    path: PathBuf,
    /// Declared above `partial`, so that the file is closed before it is renamed or removed.
    file: BufWriter<File>,
    partial: Partial,
}

impl RecordLines {
    /// Begins the file for `path`; until it is finished, its name has `.partial` appended.
    ///
    /// # Errors
    /// A file that cannot be written.
    pub fn begin(path: &Path) -> Result<Self> {
        let partial = Partial::watched(path);
        let file = partial
            .create()
            .map_err(|e| DataError::file(partial.path(), e))?;
        Ok(Self {
            path: path.to_owned(),
            file: BufWriter::new(file),
            partial,
        })
    }

    /// Adds a line.
    ///
    /// # Errors
    /// A file that cannot be written.
    pub fn add(&mut self, line: &str) -> Result<()> {
        let failed = |e| DataError::file(self.partial.path(), e);
        // Flushed line by line, so that readers of the growing file see complete frames.
        self.file.write_all(line.as_bytes()).map_err(failed)?;
        self.file.flush().map_err(failed)?;
        self.partial.keep();
        Ok(())
    }

    /// Removes the file with its lines.
    pub fn discard(self) {
        // If it cannot be removed, the next run replaces it.
        let _ = std::fs::remove_file(self.partial.path());
    }

    /// Gives the file its final name.
    ///
    /// # Errors
    /// A file that cannot be written; its lines are then still under the temporary name.
    pub fn finish(self) -> Result<()> {
        let Self {
            path,
            file,
            partial,
        } = self;
        drop(file);
        let published = partial.publish();
        Ok(published.map_err(|e| DataError::file(&path, e))?)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lines_are_visible_at_once_and_stay_when_finished() {
        let folder = tempfile::tempdir().unwrap();
        let path = record_lines_path(folder.path());
        let growing = folder.path().join("targets.jsonl.partial");
        let mut lines = RecordLines::begin(&path).unwrap();
        lines.add("{}\n").unwrap();
        assert_eq!(std::fs::read(&growing).unwrap(), b"{}\n");
        assert!(!path.exists());
        lines.finish().unwrap();
        assert_eq!(std::fs::read(&path).unwrap(), b"{}\n");
        assert!(!growing.exists());
    }

    #[test]
    fn a_file_without_lines_is_removed() {
        let folder = tempfile::tempdir().unwrap();
        let path = record_lines_path(folder.path());
        RecordLines::begin(&path).unwrap().discard();
        drop(RecordLines::begin(&path).unwrap());
        assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 0);
        // Lines are kept however the run ends, unless they are discarded.
        let begun = || {
            let mut lines = RecordLines::begin(&path).unwrap();
            lines.add("{}\n").unwrap();
            lines
        };
        drop(begun());
        assert!(folder.path().join("targets.jsonl.partial").exists());
        begun().discard();
        assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 0);
    }
}
