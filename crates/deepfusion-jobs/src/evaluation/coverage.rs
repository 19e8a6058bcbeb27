//! How many frames of a split could be used.

use std::collections::HashSet;
use std::fmt;
use std::path::PathBuf;

use deepfusion_data::{Dataset, OpenOptions, Split, SplitCoverage};
use deepfusion_hint::count_of;

use crate::{Error, Result};

/// Frames of a split that are missing or cannot be used, as a message for people.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Shortfall {
    /// Path of the split file.
    pub split: PathBuf,
    /// Number of frames that could be used.
    pub used: usize,
    /// Number of frames that the file lists.
    pub expected: usize,
    /// Why the others could not be used.
    pub why: MissingReason,
}

/// Why not all frames of a split are used.
#[derive(Debug, Clone, PartialEq, Eq)]
#[non_exhaustive]
pub enum MissingReason {
    /// The recordings do not contain them; the name of the first missing frame.
    NotThere(String),
    /// This many belong to a camera that was not opened, as in the usual lists for both cameras. More may be missing.
    OtherCamera(usize),
    /// This many exist, but without ground truth.
    NoTruth(usize),
}

impl fmt::Display for Shortfall {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { used, expected, .. } = self;
        let (split, percent) = (self.split.display(), percent(*used, *expected));
        let frames = count_of(*expected, "frame");
        match &self.why {
            MissingReason::NotThere(first) => write!(
                f,
                "{split}: found {used} of {frames} ({percent:.1} %); the first missing one is {first}"
            ),
            MissingReason::OtherCamera(others) => write!(
                f,
                "{split}: found {used} of {frames} ({percent:.1} %); {others} {} to the other camera",
                if *others == 1 { "belongs" } else { "belong" }
            ),
            MissingReason::NoTruth(without) => write!(
                f,
                "{split}: {used} of {frames} {} ground truth ({percent:.1} %); {without} {} found without",
                if *used == 1 { "has" } else { "have" },
                if *without == 1 { "was" } else { "were" }
            ),
        }
    }
}

/// The frames of a split that the recordings do not contain; `None` without a split, or if none is missing.
#[must_use]
pub fn missing_frames(options: &OpenOptions, datasets: &[Dataset]) -> Option<Shortfall> {
    let split = options.split.as_ref()?;
    let coverage = split.coverage(datasets);
    let first = coverage.first_missing?;
    Some(Shortfall {
        split: split.path.clone(),
        used: coverage.found,
        expected: coverage.expected,
        why: match of_other_camera(split, options) {
            0 => MissingReason::NotThere(first),
            others => MissingReason::OtherCamera(others),
        },
    })
}

/// The number of a split's frames that belong to a camera which the options do not open.
fn of_other_camera(split: &Split, options: &OpenOptions) -> usize {
    let opened = options.camera.cameras();
    let entries = split.entries.iter();
    let others: HashSet<_> = entries.filter(|e| !opened.contains(&e.camera)).collect();
    others.len()
}

/// The number of frames in the split, if there is one.
///
/// # Errors
/// [`Error::Incomplete`] if frames are missing and `strict` is set.
pub fn expected_frames(
    options: &OpenOptions,
    datasets: &[Dataset],
    strict: bool,
) -> Result<Option<usize>> {
    let Some(split) = &options.split else {
        return Ok(None);
    };
    let coverage = split.coverage(datasets);
    if strict && !coverage.is_complete() {
        Err(Error::Incomplete {
            split: split.path.clone(),
            found: coverage.found,
            expected: coverage.expected,
            what: if coverage.found == 1 {
                "is in the given recordings"
            } else {
                "are in the given recordings"
            },
            of_other_camera: of_other_camera(split, options),
        })
    } else {
        Ok(Some(coverage.expected))
    }
}

/// Frames of the split that are in the recordings but were not used: they have no ground truth.
///
/// # Errors
/// [`Error::Incomplete`] if some were not used and `strict` is set.
pub fn check_used(
    options: &OpenOptions,
    datasets: &[Dataset],
    used: usize,
    strict: bool,
) -> Result<Option<Shortfall>> {
    let Some(split) = &options.split else {
        return Ok(None);
    };
    let SplitCoverage {
        expected, found, ..
    } = split.coverage(datasets);
    if used >= found {
        return Ok(None);
    }
    if strict {
        return Err(Error::Incomplete {
            split: split.path.clone(),
            found: used,
            expected,
            what: if used == 1 {
                "has ground truth"
            } else {
                "have ground truth"
            },
            of_other_camera: 0,
        });
    }
    Ok(Some(Shortfall {
        split: split.path.clone(),
        used,
        expected,
        why: MissingReason::NoTruth(found - used),
    }))
}

fn percent(part: usize, whole: usize) -> f64 {
    100.0 * part as f64 / whole.max(1) as f64
}

#[cfg(test)]
mod tests {
    use super::*;
    use deepfusion_data::Cameras;
    use deepfusion_hint::Hint;
    use deepfusion_sim::{SimConfig, Simulation, write_kitti};
    use std::fmt::Write as _;
    use std::ops::ControlFlow;

    /// If a split lists both cameras and only one is opened, the message says so instead of reporting missing data.
    #[test]
    fn frames_of_the_other_camera_are_reported_as_such() {
        let at = tempfile::tempdir().unwrap();
        let simulation = Simulation::new(&SimConfig {
            frames: 4,
            width: 64,
            height: 48,
            scan_every: 0,
            stereo_baseline_m: 0.5,
            ..SimConfig::default()
        });
        let go = &mut |_, _| ControlFlow::Continue(());
        let root = write_kitti(&simulation.unwrap(), &at.path().join("kitti"), go).unwrap();
        let drive = Dataset::open(&root, &OpenOptions::default()).unwrap();
        let mut lines = String::new();
        for (frame, side) in [(0, 'l'), (1, 'r'), (2, 'r'), (1, 'r')] {
            writeln!(lines, "{} {frame} {side}", drive[0].split_name()).unwrap();
        }
        let split = at.path().join("split.txt");
        std::fs::write(&split, lines).unwrap();
        let options = |camera| OpenOptions {
            camera,
            split: Some(Split::read(&split).unwrap()),
            ..OpenOptions::default()
        };
        let left = options(Cameras::Left);
        let datasets = Dataset::open(&root, &left).unwrap();
        let shortfall = missing_frames(&left, &datasets).unwrap();
        assert_eq!(shortfall.why, MissingReason::OtherCamera(2));
        let text = shortfall.to_string();
        let expected = "split.txt: found 1 of 3 frames (33.3 %); 2 belong to the other camera";
        assert!(text.ends_with(expected), "{text}");
        let error = expected_frames(&left, &datasets, true).unwrap_err();
        assert!(error.hint().unwrap().contains("both cameras"), "{error}");

        let both = options(Cameras::Both);
        let datasets = Dataset::open(&root, &both).unwrap();
        assert_eq!(missing_frames(&both, &datasets), None);
        assert_eq!(expected_frames(&both, &datasets, true).unwrap(), Some(3));
    }
}
