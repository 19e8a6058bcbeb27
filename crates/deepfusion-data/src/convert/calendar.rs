//! Dates in UTC from nanoseconds since 1970.

use jiff::Timestamp;

/// A date like `2011_09_26`, KITTI's name for the folder of a day.
pub(super) fn date(ns: i64) -> String {
    timestamp(ns).strftime("%Y_%m_%d").to_string()
}

/// A time like `2011-09-26 13:02:25.964389445`, as KITTI writes it.
pub(super) fn stamp(ns: i64) -> String {
    timestamp(ns).strftime("%Y-%m-%d %H:%M:%S%.9f").to_string()
}

fn timestamp(ns: i64) -> Timestamp {
    // 64 bits of nanoseconds reach from 1677 to 2262, within the calendar's range.
    Timestamp::from_nanosecond(ns.into()).unwrap_or_default()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn known_times_have_the_right_dates() {
        for (days, expected) in [
            (0, "1970_01_01"),
            (-1, "1969_12_31"),
            (11_016, "2000_02_29"),
            (15_243, "2011_09_26"),
            (47_540, "2100_02_28"),
            (47_541, "2100_03_01"),
        ] {
            assert_eq!(date(days * 86_400_000_000_000), expected);
        }
        let kitti = 15_243 * 86_400 + 13 * 3600 + 2 * 60 + 25;
        for (ns, expected) in [
            (964_389_445, "2011-09-26 13:02:25.964389445"),
            (7, "2011-09-26 13:02:25.000000007"),
            (0, "2011-09-26 13:02:25.000000000"),
        ] {
            assert_eq!(stamp(kitti * 1_000_000_000 + ns), expected);
        }
        assert_eq!(stamp(-1), "1969-12-31 23:59:59.999999999");
        assert_eq!(&stamp(i64::MIN)[..4], "1677");
        assert_eq!(&stamp(i64::MAX)[..4], "2262");
    }
}
