//! How a gyroscope was understood.

/// How a gyroscope was understood of which nobody knows how it is mounted, or why it was not.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum TurnsNote {
    /// There is none, or nothing that says which way is up.
    #[error("no gyroscope with an accelerometer beside it: how the vehicle turned is unknown")]
    NoGyroscope,
    /// The accelerations are without gravity.
    #[error(
        "the accelerations beside the gyroscope hold no gravity: which way is up, and so how the vehicle turned, is unknown"
    )]
    NoGravity,
    /// Gravity says which way is up.
    #[error("yaw rate from the gyroscope about gravity's axis; {0}")]
    AboutGravity(TurnSign),
}

/// What says that turns to the left are positive.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum TurnSign {
    /// Nothing does.
    #[error(
        "taken for positive to the left, as the course of the satellites does not decide it: check the turns against the images"
    )]
    Assumed,
    /// The course, with which the readings agree.
    #[error("its sign agrees with the course of the satellites")]
    Agrees,
    /// The course, with which the readings agree once their sign is changed.
    #[error("its sign is turned round, to agree with the course of the satellites")]
    TurnedRound,
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_said_of_turns() {
        let about = TurnsNote::AboutGravity;
        for (note, said) in [
            (
                TurnsNote::NoGravity,
                "the accelerations beside the gyroscope hold no gravity: which way is up, and so how the vehicle turned, is unknown",
            ),
            (
                about(TurnSign::Assumed),
                "yaw rate from the gyroscope about gravity's axis; taken for positive to the left, as the course of the satellites does not \
                 decide it: check the turns against the images",
            ),
            (
                about(TurnSign::Agrees),
                "yaw rate from the gyroscope about gravity's axis; its sign agrees with the course of the satellites",
            ),
            (
                about(TurnSign::TurnedRound),
                "yaw rate from the gyroscope about gravity's axis; its sign is turned round, to agree with the course of the satellites",
            ),
        ] {
            assert_eq!(note.to_string(), said);
        }
    }
}
