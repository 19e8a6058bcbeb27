//! Divides a drive into a first part to learn from, and a last part to evaluate on.

use std::ops::Range;
use std::path::{Path, PathBuf};

use deepfusion_data::{Dataset, OpenOptions, Split};

use super::FRAMES;
use crate::Result;
use crate::demo::DemoFolder;
use crate::recordings::write_split;

/// Number of frames to learn from, of the usual drive; the frames after the gap are evaluated.
const LEARNED: usize = 120;
const GAP: usize = 5;

/// A drive's first part, to learn from, and its last part, to evaluate on.
pub struct SplitDrive {
    /// The whole drive.
    pub all: Dataset,
    /// Its first part.
    pub learned: Vec<Dataset>,
    /// Its last part.
    pub measured: Vec<Dataset>,
    /// Split file of the first part.
    pub learned_split: PathBuf,
}

impl SplitDrive {
    /// Divides the drive in `drive`; the split files are written into the demo's folder.
    ///
    /// # Errors
    /// A drive that cannot be opened; a split file that cannot be written.
    pub fn of(drive: &Path, folder: &DemoFolder) -> Result<Self> {
        let all = open(drive, None)?.swap_remove(0);
        let list = |name: &str, part: Range<usize>| -> Result<PathBuf> {
            let path = folder.join(name);
            write_split(&all, part, &path)?;
            Ok(path)
        };
        let frames = all.frames().len();
        let learned_split = list("learned.txt", learned_of(frames))?;
        let measured_split = list("measured.txt", measured_of(frames))?;
        Ok(Self {
            learned: open(drive, Some(&learned_split))?,
            measured: open(drive, Some(&measured_split))?,
            all,
            learned_split,
        })
    }

    /// The frame to show, from the evaluated part.
    #[must_use]
    pub fn shown_frame(&self) -> usize {
        let measured = measured_of(self.all.frames().len());
        measured.start + measured.len() / 3
    }
}

fn open(drive: &Path, split: Option<&Path>) -> Result<Vec<Dataset>> {
    let split = split.map(Split::read).transpose()?;
    Ok(Dataset::open(
        drive,
        &OpenOptions {
            split,
            ..OpenOptions::default()
        },
    )?)
}

/// The frames to learn from: the same share as of the usual drive.
fn learned_of(frames: usize) -> Range<usize> {
    0..frames * LEARNED / FRAMES
}

/// The frames to evaluate.
fn measured_of(frames: usize) -> Range<usize> {
    let gap = (frames * GAP).div_ceil(FRAMES);
    learned_of(frames).end + gap..frames
}

#[cfg(test)]
mod tests {
    use super::super::SCAN_EVERY;
    use super::*;

    /// Even a short drive has a scan among the evaluated frames, and none of them is learned from.
    #[test]
    fn every_drive_has_a_scan_to_evaluate_on() {
        assert_eq!(
            (learned_of(FRAMES), measured_of(FRAMES)),
            (0..120, 125..200)
        );
        for frames in 12..=FRAMES {
            let (learned, mut measured) = (learned_of(frames), measured_of(frames));
            assert!(learned.end < measured.start, "{frames}");
            assert!(
                measured.any(|frame| frame.is_multiple_of(SCAN_EVERY)),
                "{frames}"
            );
        }
    }
}
