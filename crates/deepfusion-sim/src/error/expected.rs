//! The values that a simulator setting may have.

/// The values that a simulator setting may have.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum ExpectedSetting {
    /// A number in this range, both ends included.
    #[error("{from} to {to}")]
    Within {
        /// Lower end.
        from: f64,
        /// Upper end.
        to: f64,
    },
    /// A length in this range, both ends included.
    #[error("{from} to {to} metres")]
    Metres {
        /// Lower end, metres.
        from: f64,
        /// Upper end, metres.
        to: f64,
    },
    /// An angle in this range, both ends included.
    #[error("{from} to {to} degrees")]
    Degrees {
        /// Lower end, degrees.
        from: f64,
        /// Upper end, degrees.
        to: f64,
    },
    /// One of these names.
    #[error("{}", either(.0))]
    OneOf(Vec<&'static str>),
    /// A drive of limited length.
    #[error("a drive of at most {minutes} minutes")]
    DriveUpTo {
        /// The longest drive, minutes.
        minutes: f64,
    },
    /// No riders, in scenes where nobody rides or walks.
    #[error("0 in garages, in rooms and on motorways")]
    NoRiders,
    /// No second camera.
    #[error("0 for a bag, which has one camera")]
    OneCamera,
    /// Plausible camera intrinsics.
    #[error("plausible intrinsics")]
    Lens,
    /// At least one scene that plain worlds have.
    #[error(
        "at least one of urban, park, garage, commercial and night, since some worlds are plain"
    )]
    PlainScene,
    /// At least one scene with roads.
    #[error("at least one scene with roads, since all cameras are on cars")]
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
    fn expected_values_are_printed_with_their_unit() {
        let (from, to) = (-0.5, 100_000.0);
        for (expected, message) in [
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
            assert_eq!(expected.to_string(), message);
        }
    }
}
