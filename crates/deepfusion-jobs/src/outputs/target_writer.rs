use std::sync::{Mutex, PoisonError};

use super::DepthWriter;
use super::earlier::remove_targets;
use crate::bulk::{
    RecordLines, add_output, record_line, record_lines_path, record_path, write_record,
    write_unsynced,
};
use crate::{PerceivedFrame, Result};

/// Writes what was found in one frame after another: pictures, depth, targets, and the file with all targets.
pub struct TargetWriter<'a> {
    depth: &'a DepthWriter<'a>,
    lines: Mutex<RecordLines>,
}

impl<'a> TargetWriter<'a> {
    /// Begins the file with all targets, in the folder of the depth outputs.
    ///
    /// # Errors
    /// A file that cannot be written.
    pub fn begin(depth: &'a DepthWriter<'a>) -> Result<Self> {
        let lines = RecordLines::begin(&record_lines_path(depth.folder))?;
        Ok(Self {
            depth,
            lines: Mutex::new(lines),
        })
    }

    /// Writes a frame, its line last, and returns that line. Does not wait for the disk.
    ///
    /// # Errors
    /// As [`DepthWriter::write`].
    pub fn write(&self, found: &PerceivedFrame) -> Result<String> {
        let (folder, input) = (self.depth.folder, &found.input);
        // Removes those of an earlier run, which may have drawn other forms. Writing depth removes the earlier depth outputs, so clouds of
        // the same name are written after it.
        remove_targets(folder, input)?;
        let mut sidecar = self
            .depth
            .write_outputs(input, &found.loaded, &found.seen)?;
        for (form, picture) in &found.pictures {
            picture.save(&form.path(folder, &input.name))?;
            // The sidecar lists them as ours: other programs' pictures may have such names.
            add_output(&mut sidecar, folder, form.file(&input.name))?;
        }
        write_unsynced(&sidecar, folder, &input.name)?;
        write_record(&found.record, &record_path(folder, &input.name))?;
        let line = record_line(&found.record)?;
        // A thread that panicked added only complete lines.
        let mut lines = self.lines.lock().unwrap_or_else(PoisonError::into_inner);
        lines.add(&line)?;
        Ok(line)
    }

    /// Gives the file with all targets its final name. If no frame is done, it is removed, and an earlier one stays.
    ///
    /// # Errors
    /// A file that cannot be written.
    pub fn finish(self, done: usize) -> Result<()> {
        let lines = self.lines.into_inner();
        let lines = lines.unwrap_or_else(PoisonError::into_inner);
        if done == 0 {
            lines.discard();
            return Ok(());
        }
        lines.finish()
    }
}
