//! Dates and times (UTC), for names and model cards.

use std::time::{SystemTime, UNIX_EPOCH};

use jiff::Timestamp;

/// The current time (UTC), such as `20260131-235959`.
#[must_use]
pub fn now() -> String {
    stamp(SystemTime::now())
}

/// The date of a time (UTC), such as `2026-01-31`.
#[must_use]
pub fn day(time: SystemTime) -> String {
    timestamp(time).strftime("%Y-%m-%d").to_string()
}

/// A time as `YYYYMMDD-HHMMSS`, UTC.
fn stamp(time: SystemTime) -> String {
    timestamp(time).strftime("%Y%m%d-%H%M%S").to_string()
}

/// The time stamp; 1970-01-01 for times before it, such as those of a clock that was never set, and for times beyond the calendar.
fn timestamp(time: SystemTime) -> Timestamp {
    Timestamp::try_from(time.max(UNIX_EPOCH)).unwrap_or_default()
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::time::Duration;

    #[test]
    fn times_are_dates() {
        // From `date -u -d @N +%Y%m%d-%H%M%S`.
        for (seconds, expected) in [
            (0, "19700101-000000"),
            (951_827_696, "20000229-123456"),
            (1_709_251_199, "20240229-235959"),
            (1_767_225_600, "20260101-000000"),
            (4_107_542_400, "21000301-000000"),
        ] {
            assert_eq!(stamp(UNIX_EPOCH + Duration::from_secs(seconds)), expected);
        }
        let leap_day = UNIX_EPOCH + Duration::from_secs(951_827_696);
        assert_eq!(day(leap_day), "2000-02-29");
        assert_eq!(day(UNIX_EPOCH - Duration::from_secs(1)), "1970-01-01");
    }
}
