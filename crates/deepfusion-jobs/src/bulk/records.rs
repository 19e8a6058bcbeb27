//! Targets on the disk: a JSON object a frame, and a line of all of them.

use std::fs::File;
use std::io::{BufWriter, Write};
use std::path::{Path, PathBuf};

use deepfusion_data::Error as DataError;
use deepfusion_fs::Partial;
use deepfusion_records::FrameRecord;

use crate::Result;

/// Where a frame's record lies.
#[must_use]
pub fn record_path(folder: &Path, name: &str) -> PathBuf {
    folder.join(format!("{name}_targets.json"))
}

/// Where the records of all frames lie, a line each.
#[must_use]
pub fn record_lines_path(folder: &Path) -> PathBuf {
    folder.join("targets.jsonl")
}

/// A frame's record as one line.
///
/// # Errors
/// A number that JSON has no form for.
pub fn record_line(record: &FrameRecord) -> Result<String> {
    Ok(serde_json::to_string(record)? + "\n")
}

/// A frame's record as a file of its own.
///
/// # Errors
/// Where it cannot be written.
pub fn write_record(record: &FrameRecord, path: &Path) -> Result<()> {
    let text = serde_json::to_string_pretty(record)? + "\n";
    let failed = |e| DataError::file(path, e);
    deepfusion_fs::write_unsynced(path, failed, |out| {
        out.write_all(text.as_bytes()).map_err(failed)
    })?;
    Ok(())
}

/// All frames, a line each, growing beside their final place under a name that readers can watch. Where it is not finished, its lines stay there;
/// without a line it is gone.
pub struct RecordLines {
    path: PathBuf,
    /// Closed before its name changes or goes: it stands above `partial`.
    file: BufWriter<File>,
    partial: Partial,
}

impl RecordLines {
    /// Begins the file that will be at `path`; it grows as the same name with `.partial` behind it.
    ///
    /// # Errors
    /// Where it cannot be written.
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
    /// Where it cannot be written.
    pub fn add(&mut self, line: &str) -> Result<()> {
        let failed = |e| DataError::file(self.partial.path(), e);
        // Line by line: who watches the file sees whole frames.
        self.file.write_all(line.as_bytes()).map_err(failed)?;
        self.file.flush().map_err(failed)?;
        self.partial.keep();
        Ok(())
    }

    /// Takes it away, with its lines.
    pub fn discard(self) {
        // What cannot be removed is taken over by the next run.
        let _ = std::fs::remove_file(self.partial.path());
    }

    /// Puts it in its place.
    ///
    /// # Errors
    /// Where it cannot be written; its lines are then still under the other name.
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
    fn lines_are_seen_as_they_come_and_stay_once_finished() {
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
    fn without_a_line_nothing_is_left() {
        let folder = tempfile::tempdir().unwrap();
        let path = record_lines_path(folder.path());
        RecordLines::begin(&path).unwrap().discard();
        drop(RecordLines::begin(&path).unwrap());
        assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 0);
        // Lines are worth keeping whatever ends the run, until it is said that they are of nothing.
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
