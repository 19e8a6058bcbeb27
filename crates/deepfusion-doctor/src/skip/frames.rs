//! Why the frames do not allow a check.

/// Why the frames do not allow a check.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum FramesSkip {
    /// The frames have no times.
    #[error("the frames have no time stamps")]
    NoTimes,
    /// No two neighbouring frames were taken while the vehicle moved.
    #[error("no neighbouring frames while the vehicle moves")]
    NoneInMotion,
    /// It is unknown whether the vehicle moved.
    #[error("the recording has no speeds")]
    NoSpeeds,
    /// The motion between two neighbours is never known.
    #[error("no pair of neighbouring frames has a known motion")]
    NoKnownMotion,
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn skip_reasons_have_their_messages() {
        for (reason, message) in [
            (
                FramesSkip::NoneInMotion,
                "no neighbouring frames while the vehicle moves",
            ),
            (FramesSkip::NoSpeeds, "the recording has no speeds"),
            (
                FramesSkip::NoKnownMotion,
                "no pair of neighbouring frames has a known motion",
            ),
        ] {
            assert_eq!(reason.to_string(), message);
        }
    }
}
