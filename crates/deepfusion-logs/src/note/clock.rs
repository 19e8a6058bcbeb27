//! How a log's clock is connected with its video's.

/// How a log's clock is connected with its video's, where neither says it.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum ClockNote {
    /// The log has dates without a zone.
    #[error("the log's dates have no zone and are taken for UTC, as the video's are")]
    NoZone,
    /// The log has dates without a zone, and no video's beginning stands beside them.
    #[error("the log's dates have no zone and are taken for UTC")]
    LocalDates,
    /// The log counts from about its own beginning.
    #[error("the log counts from its own start, which is taken for the video's first frame")]
    OwnStart,
    /// Speeds and turns are of two logs that count from starts of their own.
    #[error("the turns are of another log: both are taken to count from the same moment")]
    SameStart,
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_taken_for_granted_is_said() {
        assert_eq!(
            ClockNote::NoZone.to_string(),
            "the log's dates have no zone and are taken for UTC, as the video's are"
        );
        assert_eq!(
            ClockNote::LocalDates.to_string(),
            "the log's dates have no zone and are taken for UTC"
        );
        assert_eq!(
            ClockNote::OwnStart.to_string(),
            "the log counts from its own start, which is taken for the video's first frame"
        );
        assert_eq!(
            ClockNote::SameStart.to_string(),
            "the turns are of another log: both are taken to count from the same moment"
        );
    }
}
