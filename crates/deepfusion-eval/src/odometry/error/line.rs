//! Why a line of a file of poses is none.

/// Why a line is no pose.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum PoseLineProblem {
    /// As many columns as neither format has.
    #[error("{found} columns, expected 12 (KITTI) or 8 (TUM)")]
    Columns {
        /// How many.
        found: usize,
    },
    /// Other columns than those of the lines before.
    #[error("{found} columns, the lines before have {before}")]
    OtherColumns {
        /// How many.
        found: usize,
        /// How many the lines before have.
        before: usize,
    },
    /// A word that is no number.
    #[error("'{text}' is not a number")]
    NotANumber {
        /// Its first 40 letters.
        text: String,
    },
    /// A number that no pose has.
    #[error("{value} is no finite number")]
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
