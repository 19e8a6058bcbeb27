//! Why a log of speeds by itself does not say what a check looks for.

/// Why a log of speeds by itself does not say what a check looks for.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum LogSkip {
    /// Nothing says how sure its speeds are.
    #[error("the log does not say how sure its speeds are")]
    NoDeviation,
    /// The camera wrote it itself, on its own clock.
    #[error("the camera's own clock")]
    OwnClock,
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_a_log_lacks_is_said() {
        assert_eq!(
            LogSkip::NoDeviation.to_string(),
            "the log does not say how sure its speeds are"
        );
    }
}
