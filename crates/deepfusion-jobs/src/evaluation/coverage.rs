//! How much of a split could be used.

use std::fmt;
use std::path::PathBuf;

use deepfusion_data::{Dataset, OpenOptions, SplitCoverage};
use deepfusion_hint::count_of;

use crate::{Error, Result};

/// Frames of a split that are not there, or cannot be used; for people.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Shortfall {
    /// The split file.
    pub split: PathBuf,
    /// Frames that could be used.
    pub used: usize,
    /// Frames that the file lists.
    pub expected: usize,
    /// Why not all.
    pub why: MissingReason,
}

/// Why not all frames of a split are used.
#[derive(Debug, Clone, PartialEq, Eq)]
#[non_exhaustive]
pub enum MissingReason {
    /// The recordings do not hold them; the first that is missing.
    NotThere(String),
    /// So many are there without ground truth.
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
                "{split}: {used} of its {frames} {} there ({percent:.1} %), the first that is not: {first}",
                if *used == 1 { "is" } else { "are" }
            ),
            MissingReason::NoTruth(without) => write!(
                f,
                "{split}: {used} of its {frames} {} ground truth ({percent:.1} %), {without} more {} there without",
                if *used == 1 { "has" } else { "have" },
                if *without == 1 { "is" } else { "are" }
            ),
        }
    }
}

/// The frames of a split, where there is one, that the recordings do not hold.
#[must_use]
pub fn missing_frames(options: &OpenOptions, datasets: &[Dataset]) -> Option<Shortfall> {
    let split = options.split.as_ref()?;
    let coverage = split.coverage(datasets);
    let first = coverage.first_missing?;
    Some(Shortfall {
        split: split.path.clone(),
        used: coverage.found,
        expected: coverage.expected,
        why: MissingReason::NotThere(first.to_string()),
    })
}

/// How many frames a split asked for, where there was one.
///
/// # Errors
/// [`Error::Incomplete`] where not all are there and they must be (`strict`).
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
                "is in the recordings given"
            } else {
                "are in the recordings given"
            },
        })
    } else {
        Ok(Some(coverage.expected))
    }
}

/// Fewer frames used than the split asked for and the recordings hold: some have no ground truth.
///
/// # Errors
/// [`Error::Incomplete`] where all must be used (`strict`).
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
