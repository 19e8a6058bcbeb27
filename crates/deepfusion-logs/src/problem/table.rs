//! What is wrong with a row of a table.

use deepfusion_hint::count_of;

/// Why a row of a table cannot be read.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum TableProblem {
    /// It is not parted into values as it should be: what the parser said.
    #[error(transparent)]
    Csv(#[from] csv::Error),
    /// It has another number of values than the header.
    #[error("{}, the header has {named}", count_of(*values, "value"))]
    Values {
        /// How many it has.
        values: usize,
        /// How many the header names.
        named: usize,
    },
    /// A value is not a number.
    #[error("'{text}' is not a number")]
    NotANumber {
        /// The value, shortened.
        text: String,
    },
    /// A value is no time.
    #[error("'{text}' is not a time")]
    NotATime {
        /// The value, shortened.
        text: String,
    },
    /// Its time is before that of the row above.
    #[error("'{text}' is {back_s} s before the row above")]
    Backwards {
        /// The time as written, shortened.
        text: String,
        /// By how much, in seconds.
        back_s: f64,
    },
    /// The time of a fix is before that of the fix above.
    #[error("{back_s} s before the fix above")]
    FixBackwards {
        /// By how much, in seconds.
        back_s: f64,
    },
    /// The values of a place are no angles of the globe.
    #[error("{latitude}, {longitude} are no degrees of latitude and longitude")]
    NoDegrees {
        /// What should be its latitude.
        latitude: f64,
        /// What should be its longitude.
        longitude: f64,
    },
}
