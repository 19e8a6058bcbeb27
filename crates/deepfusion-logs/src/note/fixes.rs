//! How a receiver's fixes were interpreted.

use deepfusion_hint::count_of;

/// How a receiver's fixes were interpreted, or which were left out.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum FixesNote {
    /// The origin and the accuracy of the speeds.
    #[error(
        "speeds {}, with a median standard deviation of {sigma_mps:.2} m/s",
        if *measured { "as the receiver measured them" } else { "from its positions, smoothed" }
    )]
    Speeds {
        /// Whether enough fixes have a speed everywhere; else speeds follow from the positions, at least in parts.
        measured: bool,
        /// The median of their standard deviations, m/s.
        sigma_mps: f64,
    },
    /// Fixes without a neighbour in time, and moving fixes without a speed although others have one.
    #[error(
        "left out, as they are isolated, go back in time or lack the speed that others have: {lost} of {}",
        count_of(*fixes, "fix")
    )]
    Alone {
        /// Number of fixes left out.
        lost: usize,
        /// Number of all fixes.
        fixes: usize,
    },
    /// Fixes without a speed although others have one, whose positions do not change.
    #[error(
        "taken as standing, as they have no speed and do not change position: {standing} of {}",
        count_of(*fixes, "fix")
    )]
    Standing {
        /// Number of fixes taken as standing.
        standing: usize,
        /// Number of all fixes.
        fixes: usize,
    },
    /// Which of GnssLogger's `Fix` rows are read.
    #[error(
        "speeds of the Fix rows of {}",
        if *of_satellites { "the GPS provider" } else { "any provider: none is from GPS alone" }
    )]
    FixRows {
        /// Whether only those from GPS alone are read; if not, there are none, and network positions affect all fixes.
        of_satellites: bool,
    },
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn notes_on_fixes_as_text() {
        let speeds = |measured| FixesNote::Speeds {
            measured,
            sigma_mps: 0.123,
        };
        let fix_rows = |of_satellites| FixesNote::FixRows { of_satellites };
        for (note, text) in [
            (
                speeds(true),
                "speeds as the receiver measured them, with a median standard deviation of 0.12 m/s",
            ),
            (
                speeds(false),
                "speeds from its positions, smoothed, with a median standard deviation of 0.12 m/s",
            ),
            (
                FixesNote::Alone { lost: 1, fixes: 12 },
                "left out, as they are isolated, go back in time or lack the speed that others have: 1 of 12 fixes",
            ),
            (
                FixesNote::Standing {
                    standing: 2,
                    fixes: 12,
                },
                "taken as standing, as they have no speed and do not change position: 2 of 12 fixes",
            ),
            (fix_rows(true), "speeds of the Fix rows of the GPS provider"),
            (
                fix_rows(false),
                "speeds of the Fix rows of any provider: none is from GPS alone",
            ),
        ] {
            assert_eq!(note.to_string(), text);
        }
    }
}
