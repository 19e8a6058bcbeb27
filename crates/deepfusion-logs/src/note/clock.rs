//! How a log's clock is related to its video's.

/// How a log's clock was related to its video's, if neither gives the offset.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum ClockNote {
    /// The log has dates without a zone.
    #[error("the log's dates have no time zone and are taken as UTC, as the video's are")]
    NoZone,
    /// The log has dates without a zone, and there is no video with a creation time.
    #[error("the log's dates have no time zone and are taken as UTC")]
    LocalDates,
    /// The log counts from about its own beginning.
    #[error("the log counts from its own start, which is taken as the video's first frame")]
    OwnStart,
    /// Speeds and turns come from two logs, each counting from its own start.
    #[error("the turns are from another log: both logs are assumed to start at the same moment")]
    SameStart,
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn assumptions_about_the_clock_as_text() {
        assert_eq!(
            ClockNote::NoZone.to_string(),
            "the log's dates have no time zone and are taken as UTC, as the video's are"
        );
        assert_eq!(
            ClockNote::LocalDates.to_string(),
            "the log's dates have no time zone and are taken as UTC"
        );
        assert_eq!(
            ClockNote::OwnStart.to_string(),
            "the log counts from its own start, which is taken as the video's first frame"
        );
        assert_eq!(
            ClockNote::SameStart.to_string(),
            "the turns are from another log: both logs are assumed to start at the same moment"
        );
    }
}
