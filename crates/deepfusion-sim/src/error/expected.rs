//! What a setting of the simulator must be.

/// What a setting of the simulator must be.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum ExpectedSetting {
    /// A number from one to the other, both included.
    #[error("{from} to {to}")]
    Within {
        /// The smallest.
        from: f64,
        /// The largest.
        to: f64,
    },
    /// A length from one to the other, both included.
    #[error("{from} to {to} metres")]
    Metres {
        /// The smallest, metres.
        from: f64,
        /// The largest, metres.
        to: f64,
    },
    /// An angle from one to the other, both included.
    #[error("{from} to {to} degrees")]
    Degrees {
        /// The smallest, degrees.
        from: f64,
        /// The largest, degrees.
        to: f64,
    },
    /// One of these names.
    #[error("{}", either(.0))]
    OneOf(Vec<&'static str>),
    /// A drive that is not longer.
    #[error("a drive of at most {minutes} minutes")]
    DriveUpTo {
        /// How long it may be, minutes.
        minutes: f64,
    },
    /// Nobody who rides or walks, where nobody does.
    #[error("0 in garages, in rooms and on motorways")]
    NoRiders,
    /// No second camera.
    #[error("0 for a bag, which has one camera")]
    OneCamera,
    /// The intrinsics of a camera.
    #[error("a lens")]
    Lens,
    /// Scenes among which are some of plain worlds.
    #[error("one that simulate draws, where a share of the worlds is plain")]
    PlainScene,
    /// Scenes among which are some with roads.
    #[error("one that cars drive through, for cameras on cars")]
    SceneForCars,
}

fn either(names: &[&str]) -> String {
    match names {
        [others @ .., last] if !others.is_empty() => format!("{} or {last}", others.join(", ")),
        _ => names.concat(),
    }
}

#[cfg(test)]
mod tests {
    use super::ExpectedSetting as Expected;

    #[test]
    fn a_setting_is_said_in_words_with_its_unit() {
        let (from, to) = (-0.5, 100_000.0);
        for (expected, said) in [
            (Expected::Within { from, to }, "-0.5 to 100000"),
            (Expected::Metres { from, to }, "-0.5 to 100000 metres"),
            (Expected::Degrees { from, to }, "-0.5 to 100000 degrees"),
            (
                Expected::DriveUpTo { minutes: 30.0 },
                "a drive of at most 30 minutes",
            ),
            (Expected::OneOf(vec!["park"]), "park"),
            (Expected::OneOf(vec!["park", "night"]), "park or night"),
            (
                Expected::OneOf(vec!["urban", "park", "night"]),
                "urban, park or night",
            ),
        ] {
            assert_eq!(expected.to_string(), said);
        }
    }
}
