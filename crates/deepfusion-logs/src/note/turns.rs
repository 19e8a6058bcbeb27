//! How a gyroscope was interpreted.

/// How a gyroscope with an unknown mounting was interpreted, or why it was not used.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum TurnsNote {
    /// There is no gyroscope, or no accelerometer to find which way is up.
    #[error("no gyroscope with an accelerometer: how the vehicle turned is unknown")]
    NoGyroscope,
    /// The accelerations are without gravity.
    #[error(
        "the accelerations do not include gravity: which way is up, and so how the vehicle turned, is unknown"
    )]
    NoGravity,
    /// Gravity gives the direction of up.
    #[error("yaw rate from the gyroscope about gravity's axis; {0}")]
    AboutGravity(TurnSign),
}

/// How the sign of the turns was determined, positive to the left.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum TurnSign {
    /// It could not be determined.
    #[error(
        "taken as positive to the left, as the GPS course does not decide the sign: compare the turns with the images"
    )]
    Assumed,
    /// The readings agree with the course.
    #[error("its sign agrees with the GPS course")]
    Agrees,
    /// The readings agree with the course after a change of sign.
    #[error("its sign is reversed to agree with the GPS course")]
    TurnedRound,
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn notes_on_turns_as_text() {
        let about = TurnsNote::AboutGravity;
        for (note, text) in [
            (
                TurnsNote::NoGravity,
                "the accelerations do not include gravity: which way is up, and so how the vehicle turned, is unknown",
            ),
            (
                about(TurnSign::Assumed),
                "yaw rate from the gyroscope about gravity's axis; taken as positive to the left, as the GPS course does not decide the sign: compare the turns with the images",
            ),
            (
                about(TurnSign::Agrees),
                "yaw rate from the gyroscope about gravity's axis; its sign agrees with the GPS course",
            ),
            (
                about(TurnSign::TurnedRound),
                "yaw rate from the gyroscope about gravity's axis; its sign is reversed to agree with the GPS course",
            ),
        ] {
            assert_eq!(note.to_string(), text);
        }
    }
}
