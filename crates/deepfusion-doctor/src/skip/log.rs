//! Why a log of speeds does not allow a check.

/// Why a log of speeds does not allow a check.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum LogSkip {
    /// The uncertainty of the speeds is unknown.
    #[error("the log does not give the uncertainty of its speeds")]
    NoDeviation,
    /// The camera wrote the log itself, on its own clock.
    #[error("the log is on the camera's own clock")]
    OwnClock,
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn skip_reasons_have_their_messages() {
        assert_eq!(
            LogSkip::NoDeviation.to_string(),
            "the log does not give the uncertainty of its speeds"
        );
    }
}
