//! What is wrong with a row of a table.

use deepfusion_hint::count_of;

/// Why a row of a table cannot be read.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum TableProblem {
    /// The row cannot be split into values; the parser's error.
    #[error(transparent)]
    Csv(#[from] csv::Error),
    /// The row has another number of values than the header.
    #[error("{}, the header has {named}", count_of(*values, "value"))]
    Values {
        /// Number of values in the row.
        values: usize,
        /// Number of values in the header.
        named: usize,
    },
    /// A value is not a number.
    #[error("'{text}' is not a number")]
    NotANumber {
        /// The value, shortened.
        text: String,
    },
    /// A value is not a time.
    #[error("'{text}' is not a time")]
    NotATime {
        /// The value, shortened.
        text: String,
    },
    /// The row's time is before that of the row above.
    #[error("'{text}' is {back_s} s before the row above")]
    Backwards {
        /// The time as written, shortened.
        text: String,
        /// Difference from the row above, in seconds.
        back_s: f64,
    },
    /// The time of a fix is before that of the fix above.
    #[error("{back_s} s before the fix above")]
    FixBackwards {
        /// Difference from the fix above, in seconds.
        back_s: f64,
    },
    /// The values of a position are not angles on the globe.
    #[error("{latitude}, {longitude} is not a latitude and longitude in degrees")]
    NoDegrees {
        /// The value in the latitude's column.
        latitude: f64,
        /// The value in the longitude's column.
        longitude: f64,
    },
}
