//! Which shares and ranges the factors of intervals are for, and why some are none.

/// Shares of the pixels that intervals are to hold.
pub const LEVELS: [f64; 3] = [0.5, 0.8, 0.95];

/// Where the ranges of predicted depth end, metres; the last goes on.
pub(crate) const ENDS_M: [f64; 3] = [10.0, 20.0, 40.0];

/// Why factors are none of this program's.
#[derive(Debug, Clone, Copy, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum IntervalsProblem {
    /// They are for other shares of the pixels than [`LEVELS`].
    #[error("levels {found:?}, expected {:?}", LEVELS)]
    Levels {
        /// The shares.
        found: [f64; 3],
    },
    /// They are for other ranges of depths.
    #[error("ranges other than those ending at {:?} m", ENDS_M)]
    Ranges,
    /// One that is negative or NaN.
    #[error("a factor of {factor}")]
    Factor {
        /// The factor.
        factor: f64,
    },
}
