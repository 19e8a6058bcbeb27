//! Errors when trajectories are compared, and in their files.

use deepfusion_fs::FileError;
use deepfusion_hint::{Hint, count_of};
use std::path::PathBuf;

/// Two trajectories that cannot be compared.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum TrackError {
    /// The numbers of poses differ.
    #[error("{name}: {}, {}", count_of(*predicted, "predicted pose"), count_of(*truth, "true pose"))]
    Lengths {
        /// Name of the drive.
        name: String,
        /// Number of predicted poses.
        predicted: usize,
        /// Number of true poses.
        truth: usize,
    },
    /// Too few poses for a single motion.
    #[error("{name}: {}, expected at least 2", count_of(*poses, "pose"))]
    TooShort {
        /// Name of the drive.
        name: String,
        /// Number of poses.
        poses: usize,
    },
    /// Too few of the two files' times agree.
    #[error(
        "{name}: only {matched} of {} {} within {within_s} s of {}",
        count_of(*predicted, "predicted time"),
        if *matched == 1 || *predicted == 1 { "is" } else { "are" },
        one_of(*truth)
    )]
    Times {
        /// Name of the predicted file.
        name: String,
        /// Number of predicted poses that have a true pose.
        matched: usize,
        /// Number of predicted poses.
        predicted: usize,
        /// Number of true poses.
        truth: usize,
        /// Largest difference of matching times, in seconds.
        within_s: f64,
    },
}

/// The true times, in words.
fn one_of(truth: usize) -> String {
    if truth == 1 {
        "the true time".to_owned()
    } else {
        format!("one of the {truth} true times")
    }
}

impl Hint for TrackError {
    fn hint(&self) -> Option<String> {
        Some(
            match self {
                Self::Lengths { .. } => {
                    "write a pose for every frame in both files, or use TUM files: files without times are matched line by line"
                }
                Self::TooShort { .. } => "give a drive with at least two consecutive frames",
                Self::Times { .. } => "count seconds from the same moment in both files",
            }
            .into(),
        )
    }
}

/// A pose file that cannot be read or written.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum PoseFileError {
    /// The file cannot be opened or written.
    #[error(transparent)]
    File(#[from] FileError),
    /// A line is not a pose.
    #[error("{}:{line}: {problem}", path.display())]
    Line {
        /// Path of the file.
        path: PathBuf,
        /// The line's number, from 1.
        line: usize,
        /// What is wrong with the line.
        problem: PoseLineProblem,
    },
    /// The file contains no poses.
    #[error("{}: contains no poses", path.display())]
    Empty {
        /// Path of the file.
        path: PathBuf,
    },
}

impl Hint for PoseFileError {
    fn hint(&self) -> Option<String> {
        match self {
            Self::File(error) => error.hint(),
            Self::Line { .. } | Self::Empty { .. } => Some(
                "write one pose of the camera in the world per line: KITTI's 12 numbers (the rows of [R t]), or TUM's \
                 8 (time tx ty tz qx qy qz qw); # starts a comment"
                    .into(),
            ),
        }
    }
}

/// Why a line is not a pose.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum PoseLineProblem {
    /// The number of columns matches neither format.
    #[error("{}, expected 12 (KITTI) or 8 (TUM)", count_of(*found, "column"))]
    Columns {
        /// Number of columns found.
        found: usize,
    },
    /// The number of columns differs from the previous lines.
    #[error("{}, expected {before} as in the lines before", count_of(*found, "column"))]
    OtherColumns {
        /// Number of columns found.
        found: usize,
        /// Number of columns in the lines before.
        before: usize,
    },
    /// A word is not a number.
    #[error("'{text}' is not a number")]
    NotANumber {
        /// The word's first 40 characters.
        text: String,
    },
    /// A number is infinite or NaN.
    #[error("{value} is not a finite number")]
    NotFinite {
        /// The number.
        value: f64,
    },
    /// The first three columns are not a rotation.
    #[error(
        "its first three columns are not a rotation (R·Rᵀ is {off:.2e} from the identity, its determinant {determinant:.3})"
    )]
    Rotation {
        /// Distance of R·Rᵀ from the identity (Frobenius norm).
        off: f64,
        /// The determinant of R.
        determinant: f64,
    },
    /// The quaternion does not have length 1.
    #[error("its quaternion has length {length:.4}, expected 1")]
    Quaternion {
        /// Length of the quaternion.
        length: f64,
    },
    /// Times do not increase.
    #[error("time {time_s} is not after {before_s}, the time before")]
    Time {
        /// The line's time, in seconds.
        time_s: f64,
        /// Time of the line before, in seconds.
        before_s: f64,
    },
}
