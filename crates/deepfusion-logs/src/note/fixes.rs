//! How a receiver's fixes were understood.

use deepfusion_hint::count_of;

/// How a receiver's fixes were understood, or which were left out.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum FixesNote {
    /// How the speeds come about, and how sure they are.
    #[error(
        "speeds {}, sure to {sigma_mps:.2} m/s in the middle",
        if *measured { "as the receiver measured them" } else { "from its positions, smoothed" }
    )]
    Speeds {
        /// Whether enough fixes have one everywhere; else they follow from the positions, at least in parts.
        measured: bool,
        /// The median of their standard deviations, m/s.
        sigma_mps: f64,
    },
    /// Fixes without a neighbour in time, and moving ones without a speed among those that have one.
    #[error(
        "left out, as they stand alone, go back in time or lack the speed that others have: {lost} of {}",
        count_of(*fixes, "fix")
    )]
    Alone {
        /// How many.
        lost: usize,
        /// How many fixes there are.
        fixes: usize,
    },
    /// Fixes without a speed among those that have one, whose positions stand.
    #[error(
        "taken to stand, as they have no speed and their positions do: {standing} of {}",
        count_of(*fixes, "fix")
    )]
    Standing {
        /// How many.
        standing: usize,
        /// How many fixes there are.
        fixes: usize,
    },
    /// Which of GnssLogger's `Fix` rows are read.
    #[error(
        "speeds of the Fix rows of {}",
        if *of_satellites { "satellites alone (GPS)" } else { "any provider: none is of satellites alone" }
    )]
    FixRows {
        /// Whether those of satellites alone; else there are none, and networks have their part in all.
        of_satellites: bool,
    },
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_said_of_fixes() {
        let speeds = |measured| FixesNote::Speeds {
            measured,
            sigma_mps: 0.123,
        };
        let fix_rows = |of_satellites| FixesNote::FixRows { of_satellites };
        for (note, said) in [
            (
                speeds(true),
                "speeds as the receiver measured them, sure to 0.12 m/s in the middle",
            ),
            (
                speeds(false),
                "speeds from its positions, smoothed, sure to 0.12 m/s in the middle",
            ),
            (
                FixesNote::Alone { lost: 1, fixes: 12 },
                "left out, as they stand alone, go back in time or lack the speed that others have: 1 of 12 fixes",
            ),
            (
                FixesNote::Standing {
                    standing: 2,
                    fixes: 12,
                },
                "taken to stand, as they have no speed and their positions do: 2 of 12 fixes",
            ),
            (
                fix_rows(true),
                "speeds of the Fix rows of satellites alone (GPS)",
            ),
            (
                fix_rows(false),
                "speeds of the Fix rows of any provider: none is of satellites alone",
            ),
        ] {
            assert_eq!(note.to_string(), said);
        }
    }
}
