//! Targets on the disk: a JSON object a frame, and a line of all of them.

use std::io::{BufWriter, Write};
use std::path::{Path, PathBuf};

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
    let failed = |e| deepfusion_data::Error::file(path, e);
    deepfusion_fs::write_unsynced(path, failed, |out| {
        out.write_all(text.as_bytes()).map_err(failed)
    })?;
    Ok(())
}

/// All frames, a line each, growing beside its final place.
pub struct RecordLines {
    path: PathBuf,
    partial: PathBuf,
    file: BufWriter<std::fs::File>,
}

impl RecordLines {
    /// Begins the file that will be at `path`.
    ///
    /// # Errors
    /// Where it cannot be written.
    pub fn begin(path: &Path) -> Result<Self> {
        let partial = path.with_extension("jsonl.partial");
        let file = std::fs::File::create(&partial)
            .map_err(|e| deepfusion_data::Error::file(&partial, e))?;
        Ok(Self {
            path: path.to_owned(),
            partial,
            file: BufWriter::new(file),
        })
    }

    /// Adds a line.
    ///
    /// # Errors
    /// Where it cannot be written.
    pub fn add(&mut self, line: &str) -> Result<()> {
        let failed = |e| deepfusion_data::Error::file(&self.partial, e);
        // Line by line: who watches the file sees whole frames.
        self.file.write_all(line.as_bytes()).map_err(failed)?;
        Ok(self.file.flush().map_err(failed)?)
    }

    /// Takes it away: nothing came.
    pub fn discard(self) {
        // What is left is an empty file that the next run takes over.
        let _ = std::fs::remove_file(&self.partial);
    }

    /// Puts it in its place.
    ///
    /// # Errors
    /// Where it cannot be written.
    pub fn finish(self) -> Result<()> {
        deepfusion_fs::publish(&self.partial, &self.path)
            .map_err(|e| deepfusion_data::Error::file(&self.path, e))?;
        Ok(())
    }
}
