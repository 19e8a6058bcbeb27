//! What can go wrong with paths that are compared, and with their files.

use deepfusion_hint::{Hint, count_of, system_hint};
use std::path::PathBuf;

/// Two paths that cannot be compared.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum TrackError {
    /// They have different numbers of poses.
    #[error("{name}: {}, {}", count_of(*predicted, "predicted pose"), count_of(*truth, "true one"))]
    Lengths {
        /// The drive.
        name: String,
        /// Number of predicted poses.
        predicted: usize,
        /// Number of true poses.
        truth: usize,
    },
    /// There is no motion to compare.
    #[error("{name}: {}, and a motion takes two", count_of(*poses, "pose"))]
    TooShort {
        /// The drive.
        name: String,
        /// How many poses there are.
        poses: usize,
    },
    /// Files with times of which too few agree.
    #[error(
        "{name}: only {matched} of {} {} within {within_s} s of {}",
        count_of(*predicted, "predicted time"),
        if *matched == 1 || *predicted == 1 { "is" } else { "are" },
        one_of(*truth)
    )]
    Times {
        /// The predicted file.
        name: String,
        /// How many poses have a partner.
        matched: usize,
        /// Number of predicted poses.
        predicted: usize,
        /// Number of true poses.
        truth: usize,
        /// How near two times must be, in seconds.
        within_s: f64,
    },
}

/// One of so many true times.
fn one_of(truth: usize) -> String {
    if truth == 1 {
        "the true one".to_owned()
    } else {
        format!("one of the {truth} true ones")
    }
}

impl Hint for TrackError {
    fn hint(&self) -> Option<String> {
        Some(
            match self {
                Self::Lengths { .. } => {
                    "files without times are matched line by line: write a pose for every frame of both, or TUM files"
                }
                Self::TooShort { .. } => "give at least two consecutive frames",
                Self::Times { .. } => "both files must count seconds from the same moment",
            }
            .into(),
        )
    }
}

/// A pose file that cannot be read.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum PoseFileError {
    /// It cannot be opened or written.
    #[error("{}: {source}", path.display())]
    Io {
        /// The file.
        path: PathBuf,
        /// What the system said.
        source: std::io::Error,
    },
    /// A line is no pose.
    #[error("{}:{line}: {problem}", path.display())]
    Line {
        /// The file.
        path: PathBuf,
        /// The line, counted from 1.
        line: usize,
        /// What is wrong with it.
        problem: PoseLineProblem,
    },
    /// It holds no pose at all.
    #[error("{}: no pose in it", path.display())]
    Empty {
        /// The file.
        path: PathBuf,
    },
}

impl Hint for PoseFileError {
    fn hint(&self) -> Option<String> {
        match self {
            Self::Io { source, .. } => Some(system_hint(source.kind()).into()),
            Self::Line { .. } | Self::Empty { .. } => Some(
                "a line is a pose of the camera in the world: KITTI's 12 numbers (the rows of [R t]), or TUM's \
                 8 (time tx ty tz qx qy qz qw); # starts a comment"
                    .into(),
            ),
        }
    }
}

/// Why a line is no pose.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum PoseLineProblem {
    /// As many columns as neither format has.
    #[error("{}, expected 12 (KITTI) or 8 (TUM)", count_of(*found, "column"))]
    Columns {
        /// How many.
        found: usize,
    },
    /// Other columns than those of the lines before.
    #[error("{}, the lines before have {before}", count_of(*found, "column"))]
    OtherColumns {
        /// How many.
        found: usize,
        /// How many the lines before have.
        before: usize,
    },
    /// A word that is not a number.
    #[error("'{text}' is not a number")]
    NotANumber {
        /// Its first 40 letters.
        text: String,
    },
    /// A number that no pose has.
    #[error("{value} is not a finite number")]
    NotFinite {
        /// The number.
        value: f64,
    },
    /// Three rows that are no rotation.
    #[error(
        "its first three columns are no rotation (R·Rᵀ is {off:.2e} from the identity, its determinant {determinant:.3})"
    )]
    Rotation {
        /// How far R·Rᵀ is from the identity.
        off: f64,
        /// The determinant.
        determinant: f64,
    },
    /// Four numbers that are no rotation.
    #[error("its quaternion has length {length:.4}, a rotation's has 1")]
    Quaternion {
        /// The length.
        length: f64,
    },
    /// A time that does not rise.
    #[error("time {time_s} is not after {before_s}, the one before")]
    Time {
        /// The time, in seconds.
        time_s: f64,
        /// That of the line before.
        before_s: f64,
    },
}
