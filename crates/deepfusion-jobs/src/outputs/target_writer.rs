use std::sync::{Mutex, PoisonError};

use super::DepthWriter;
use super::earlier::remove_targets;
use crate::bulk::{
    RecordLines, add_output, record_line, record_lines_path, record_path, write_record,
    write_unsynced,
};
use crate::{PerceivedFrame, Result};

/// Writes what was found in frame after frame: pictures, depth, targets, and the file of all targets.
pub struct TargetWriter<'a> {
    depth: &'a DepthWriter<'a>,
    lines: Mutex<RecordLines>,
}

impl<'a> TargetWriter<'a> {
    /// Begins the file of all targets, where the depth is written.
    ///
    /// # Errors
    /// Where it cannot be written.
    pub fn begin(depth: &'a DepthWriter<'a>) -> Result<Self> {
        let lines = RecordLines::begin(&record_lines_path(depth.folder))?;
        Ok(Self {
            depth,
            lines: Mutex::new(lines),
        })
    }

    /// Writes a frame, its line last, and gives that line. Nothing is waited for until it is on the disk.
    ///
    /// # Errors
    /// As [`DepthWriter::write`].
    pub fn write(&self, found: &PerceivedFrame) -> Result<String> {
        let (folder, input) = (self.depth.folder, &found.input);
        // Of an earlier run, which may have drawn others. What it left of depth goes with the depth that is written: clouds of the same name come after it.
        remove_targets(folder, input)?;
        let mut sidecar = self
            .depth
            .write_outputs(input, &found.loaded, &found.seen)?;
        for (form, picture) in &found.pictures {
            picture.save(&form.path(folder, &input.name))?;
            // Whose they are says the sidecar: other pictures may have such names.
            add_output(&mut sidecar, folder, form.file(&input.name))?;
        }
        write_unsynced(&sidecar, folder, &input.name)?;
        write_record(&found.record, &record_path(folder, &input.name))?;
        let line = record_line(&found.record)?;
        // Who panicked added whole lines only.
        let mut lines = self.lines.lock().unwrap_or_else(PoisonError::into_inner);
        lines.add(&line)?;
        Ok(line)
    }

    /// Puts the file of all targets in its place; where no frame is done, it is taken away, and an earlier one stays.
    ///
    /// # Errors
    /// Where it cannot be written.
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
