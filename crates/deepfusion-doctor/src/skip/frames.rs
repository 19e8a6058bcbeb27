//! Why frames do not show what a check looks for.

/// Why frames do not show what a check looks for.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum FramesSkip {
    /// They have no times.
    #[error("the frames have no time stamps")]
    NoTimes,
    /// None of them neighbour another in motion.
    #[error("no neighbouring frames while the vehicle moves")]
    NoneInMotion,
    /// Nothing says whether the vehicle moved.
    #[error("the recording has no speeds")]
    NoSpeeds,
    /// Of no two neighbours the motion between them is known.
    #[error("no pair of neighbouring frames has a known motion")]
    NoKnownMotion,
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_frames_lack_is_said() {
        for (reason, said) in [
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
            assert_eq!(reason.to_string(), said);
        }
    }
}
