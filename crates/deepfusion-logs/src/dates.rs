//! Times of a column: numbers of some unit, dates in the forms that recorders write, times of day.

use crate::log::Clock;
use jiff::civil::{DateTime, Time};
use jiff::fmt::strtime;

/// Seconds since 1970 from 2000 to 2100: numbers in this range times a unit are taken as dates.
const EPOCH_S: std::ops::RangeInclusive<f64> = 9.46e8..=4.102e9;
/// Dates that are not ISO 8601: Torque's device time, Torque's GPS time, German and year-first ones.
const DATES: [&str; 6] = [
    "%d-%b-%Y %H:%M:%S%.f",
    "%a %b %d %H:%M:%S GMT%:z %Y",
    "%a %b %d %H:%M:%S %Y",
    "%d.%m.%Y %H:%M:%S%.f",
    "%Y/%m/%d %H:%M:%S%.f",
    "%Y-%m-%d %H-%M-%S%.f",
];
const DAY_NS: i64 = 86_400_000_000_000;

/// How the times of a column are written.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum TimeStyle {
    /// A number, with the nanoseconds of its unit.
    Number(i64),
    /// A date with its zone, or without.
    Date,
    /// Hours, minutes and seconds.
    TimeOfDay,
}

/// Nanoseconds of a unit by its name.
pub(crate) fn unit_ns(name: &str) -> Option<i64> {
    match name.trim().to_lowercase().as_str() {
        "s" | "sec" | "secs" | "second" | "seconds" => Some(1_000_000_000),
        "ms" | "msec" | "millis" | "milliseconds" => Some(1_000_000),
        "us" | "usec" | "µs" | "micros" | "microseconds" => Some(1000),
        "ns" | "nsec" | "nanos" | "nanoseconds" => Some(1),
        _ => None,
    }
}

/// How the first times of a column are written; `unit` is the unit in its header. `None` if it cannot be known: plain numbers
/// that are not dates, and further apart than seconds would be.
pub(crate) fn style_of(words: &[&str], unit: Option<&str>) -> Option<TimeStyle> {
    let first = *words.first()?;
    if first.parse::<f64>().is_err() {
        return match (parse_date(first), time_of_day(first)) {
            (Some(_), _) => Some(TimeStyle::Date),
            (None, Some(_)) => Some(TimeStyle::TimeOfDay),
            (None, None) => None,
        };
    }
    if let Some(ns) = unit.and_then(unit_ns) {
        return Some(TimeStyle::Number(ns));
    }
    let numbers: Vec<f64> = words.iter().filter_map(|w| w.parse().ok()).collect();
    let of_date = [1_000_000_000, 1_000_000, 1000, 1]
        .into_iter()
        .find(|ns| EPOCH_S.contains(&(numbers[0] * *ns as f64 * 1e-9)));
    if let Some(ns) = of_date {
        return Some(TimeStyle::Number(ns));
    }
    let mut steps: Vec<f64> = numbers.windows(2).map(|w| (w[1] - w[0]).abs()).collect();
    steps.sort_by(f64::total_cmp);
    // Several rows may have the same time.
    steps.retain(|step| *step > 0.0);
    let median = *steps.get(steps.len() / 2)?;
    // Steps of 40 could be milliseconds or frames.
    (median <= 1.0).then_some(TimeStyle::Number(1_000_000_000))
}

/// A time in nanoseconds; `after` is the preceding time in the column, for clocks that pass midnight.
pub(crate) fn nanoseconds(word: &str, style: TimeStyle, after: Option<i64>) -> Option<i64> {
    match style {
        TimeStyle::Number(unit_ns) => number_ns(word, unit_ns),
        TimeStyle::Date => parse_date(word).map(|(ns, _)| ns),
        TimeStyle::TimeOfDay => {
            let ns = time_of_day(word)?;
            let Some(after) = after else { return Some(ns) };
            let days = after.div_euclid(DAY_NS);
            let same_day = days * DAY_NS + ns;
            // A step back of more than half a day is a passed midnight; a smaller one is a clock that went back, which is reported elsewhere.
            let passed = same_day < after - DAY_NS / 2;
            Some(same_day + if passed { DAY_NS } else { 0 })
        }
    }
}

/// The clock of times in this style.
pub(crate) fn clock_of(word: &str, style: TimeStyle) -> Clock {
    match style {
        TimeStyle::TimeOfDay => Clock::TimeOfDay,
        TimeStyle::Date if parse_date(word).is_some_and(|(_, zoned)| zoned) => Clock::Date,
        TimeStyle::Date => Clock::LocalDate,
        TimeStyle::Number(unit_ns) => {
            let seconds = word.parse::<f64>().unwrap_or(0.0) * unit_ns as f64 * 1e-9;
            if EPOCH_S.contains(&seconds) {
                Clock::Date
            } else {
                Clock::Free
            }
        }
    }
}

/// A time as a user writes it, in nanoseconds on a log's clock: seconds as a number, a date, or a time of day. A date without a zone is
/// in the log's own zone. A time of day is the one within the log, whose first and last times are `span_ns`, or the nearest to it. For a
/// log of local dates, `zone_s` seconds ahead of UTC, `span_ns` is on the local clock and the result in UTC, as after
/// [`in_zone`](crate::DriveLog::in_zone).
#[must_use]
pub fn time_on_clock(word: &str, clock: Clock, span_ns: (i64, i64), zone_s: i64) -> Option<i64> {
    let word = word.trim();
    if word.parse::<f64>().is_ok() {
        return number_ns(word, 1_000_000_000);
    }
    let of_local = |ns: i64| match clock {
        Clock::LocalDate => ns.saturating_sub(zone_s.saturating_mul(1_000_000_000)),
        _ => ns,
    };
    match (parse_date(word), clock) {
        (Some((ns, true)), Clock::Date | Clock::LocalDate) => Some(ns),
        (Some((ns, false)), Clock::Date | Clock::LocalDate) => Some(of_local(ns)),
        (Some((ns, _)), Clock::TimeOfDay) => Some(nearest_day(ns, span_ns)),
        (Some(_), Clock::Free | Clock::Video) => None,
        (None, Clock::Date | Clock::LocalDate | Clock::TimeOfDay) => {
            Some(of_local(nearest_day(time_of_day(word)?, span_ns)))
        }
        // Some apps continue counting the seconds of a day after midnight.
        (None, Clock::Free) if (DAY_NS / 2..DAY_NS).contains(&span_ns.0) => {
            Some(nearest_day(time_of_day(word)?, span_ns))
        }
        (None, Clock::Free | Clock::Video) => time_of_day(word),
    }
}

/// The moment at this time of day that is within a span, or nearest to it: a log that begins before midnight may have its video after it.
fn nearest_day(ns: i64, (first_ns, last_ns): (i64, i64)) -> i64 {
    let after = first_ns.saturating_add((ns - first_ns).rem_euclid(DAY_NS));
    let before = after.saturating_sub(DAY_NS);
    let (late, early) = (
        after.saturating_sub(last_ns),
        first_ns.saturating_sub(before),
    );
    if late > early { before } else { after }
}

/// A number with a unit, exact to the last digit: an f64 of seconds since 1970 is only exact to a quarter of a microsecond.
fn number_ns(word: &str, unit_ns: i64) -> Option<i64> {
    let (negative, digits) = match word.strip_prefix('-') {
        Some(rest) => (true, rest),
        None => (false, word.strip_prefix('+').unwrap_or(word)),
    };
    let (whole, fraction) = digits.split_once('.').unwrap_or((digits, ""));
    let plain = |s: &str| s.bytes().all(|b| b.is_ascii_digit());
    if !plain(whole) || !plain(fraction) || whole.is_empty() {
        let value = word.parse::<f64>().ok()? * unit_ns as f64;
        return (value.abs() < 9e18).then_some(value.round() as i64);
    }
    let whole = whole.parse::<i64>().ok()?.checked_mul(unit_ns)?;
    let part = if fraction.is_empty() {
        0.0
    } else {
        format!("0.{fraction}").parse::<f64>().ok()? * unit_ns as f64
    };
    let value = whole.checked_add(part.round() as i64)?;
    Some(if negative { -value } else { value })
}

/// A date with a time of day as recorders write it (ISO 8601, or a form used by some apps): nanoseconds since 1970, and whether it has a
/// time zone. Without one it is taken as UTC.
#[must_use]
pub fn parse_date(word: &str) -> Option<(i64, bool)> {
    let word = word.trim();
    let ns = |stamp: jiff::Timestamp| i64::try_from(stamp.as_nanosecond()).ok();
    if let Ok(stamp) = word.parse::<jiff::Timestamp>() {
        return Some((ns(stamp)?, true));
    }
    let civil = |local: DateTime| {
        let stamp = local.to_zoned(jiff::tz::TimeZone::UTC).ok()?.timestamp();
        Some((ns(stamp)?, false))
    };
    // A date alone is not a time.
    if word.contains(':')
        && let Ok(local) = word.parse::<DateTime>()
    {
        return civil(local);
    }
    DATES.iter().find_map(|format| {
        let parsed = strtime::parse(format, word).ok()?;
        match parsed.offset() {
            Some(_) => Some((ns(parsed.to_timestamp().ok()?)?, true)),
            None => civil(parsed.to_datetime().ok()?),
        }
    })
}

/// A time of day in nanoseconds since midnight.
fn time_of_day(word: &str) -> Option<i64> {
    let time: Time = word.trim().parse().ok()?;
    (word.contains(':')).then(|| {
        let seconds = i64::from(time.hour()) * 3600 + i64::from(time.minute()) * 60;
        (seconds + i64::from(time.second())) * 1_000_000_000 + i64::from(time.subsec_nanosecond())
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    const SECOND: i64 = 1_000_000_000;

    #[test]
    fn dates_as_recorders_write_them() {
        let noon = 1_569_153_600 * SECOND;
        for (word, ns, zoned) in [
            ("2019-09-22T12:00:00Z", noon, true),
            ("2019-09-22T14:00:00.250+02:00", noon + SECOND / 4, true),
            ("2019-09-22 12:00:00.5", noon + SECOND / 2, false),
            ("22-Sep-2019 12:00:00.345", noon + 345_000_000, false),
            ("Sun Sep 22 14:00:00 GMT+02:00 2019", noon, true),
            ("22.09.2019 12:00:01", noon + SECOND, false),
            ("2019/09/22 12:00:00", noon, false),
        ] {
            assert_eq!(parse_date(word), Some((ns, zoned)), "{word}");
        }
        for word in ["", "2019-09-22", "tomorrow", "12.5", "31-Feb-2019 10:00:00"] {
            assert_eq!(parse_date(word), None, "{word}");
        }
    }

    #[test]
    fn a_clock_passes_midnight() {
        let style = TimeStyle::TimeOfDay;
        let before = nanoseconds("23:59:59.5", style, None).unwrap();
        let after = nanoseconds("00:00:00.5", style, Some(before)).unwrap();
        assert_eq!(after - before, SECOND);
        let next = nanoseconds("00:00:01", style, Some(after)).unwrap();
        assert_eq!(next - after, SECOND / 2);
        // A clock that steps back by less is not moved to the next day.
        let back = nanoseconds("00:00:00", style, Some(after)).unwrap();
        assert_eq!(back - after, -SECOND / 2);
    }

    #[test]
    fn the_unit_of_plain_numbers_is_inferred_or_unknown() {
        let style = |words: &[&str], unit| style_of(words, unit);
        assert_eq!(
            style(&["0", "0.5", "1"], None),
            Some(TimeStyle::Number(SECOND))
        );
        assert_eq!(style(&["0", "40", "80"], None), None);
        assert_eq!(
            style(&["0", "40", "80"], Some("ms")),
            Some(TimeStyle::Number(1_000_000))
        );
        assert_eq!(
            style(&["1569153600123", "1569153600223"], None),
            Some(TimeStyle::Number(1_000_000))
        );
        assert_eq!(style(&["soon"], None), None);
        let ns = nanoseconds("1569153600.123456789", TimeStyle::Number(SECOND), None);
        assert_eq!(ns, Some(1_569_153_600_123_456_789));
    }

    #[test]
    fn a_users_time_is_on_the_logs_clock() {
        let noon = 1_569_153_600 * SECOND;
        let midnight = noon - 12 * 3600 * SECOND;
        for (word, clock, ns) in [
            ("2.5", Clock::Free, Some(5 * SECOND / 2)),
            ("12:00:00", Clock::Date, Some(noon)),
            ("12:00:00", Clock::Free, Some(12 * 3600 * SECOND)),
            ("2019-09-22T14:00:00+02:00", Clock::Date, Some(noon)),
            (
                "2019-09-22 12:00:00",
                Clock::TimeOfDay,
                Some(noon - midnight),
            ),
            ("2019-09-22 12:00:00", Clock::Free, None),
            ("later", Clock::Date, None),
        ] {
            let first = match clock {
                Clock::Date => midnight + 5 * SECOND,
                _ => 5 * SECOND,
            };
            assert_eq!(time_on_clock(word, clock, (first, first), 0), ns, "{word}");
        }
    }

    #[test]
    fn a_time_past_midnight_is_on_the_next_day() {
        let day = DAY_NS / SECOND;
        for (first_s, word, clock, expected_s) in [
            (day - 10, "00:00:10", Clock::TimeOfDay, day + 10),
            (day - 10, "00:00:10", Clock::Free, day + 10),
            (700 * day - 10, "00:00:10", Clock::Date, 700 * day + 10),
            (700 * day + 10, "23:59:50", Clock::Date, 700 * day - 10),
            (
                700 * day + 10,
                "11:00:00",
                Clock::Date,
                700 * day + 11 * 3600,
            ),
            (0, "00:01:30", Clock::Free, 90),
            (
                700 * day + 10,
                "13:00:00",
                Clock::Date,
                699 * day + 13 * 3600,
            ),
        ] {
            // Ten minutes.
            let span = (first_s * SECOND, (first_s + 600) * SECOND);
            let ns = time_on_clock(word, clock, span, 0);
            assert_eq!(ns, Some(expected_s * SECOND), "{word} of {clock:?}");
        }
    }

    #[test]
    fn a_time_of_a_long_day_is_within_the_log() {
        let (morning, evening) = (6 * 3600 * SECOND, 20 * 3600 * SECOND);
        let ns = time_on_clock("19:00:00", Clock::Date, (morning, evening), 0);
        assert_eq!(ns, Some(19 * 3600 * SECOND));
    }

    #[test]
    fn a_time_of_a_local_clock_is_in_its_zone() {
        let (noon, zone_s) = (1_569_153_600 * SECOND, 7200);
        // The log begins at 14:00 local time.
        let first = noon + 7200 * SECOND;
        for word in ["14:00:00", "2019-09-22 14:00:00", "2019-09-22T12:00:00Z"] {
            assert_eq!(
                time_on_clock(word, Clock::LocalDate, (first, first), zone_s),
                Some(noon),
                "{word}"
            );
        }
        let utc = time_on_clock("12:00:00", Clock::Date, (noon, noon), zone_s);
        assert_eq!(utc, Some(noon), "a date with a zone stays as it is");
    }

    #[test]
    fn rows_with_equal_times_do_not_affect_the_unit() {
        let words = ["0", "0", "0", "500", "500", "500", "1000", "1000"];
        assert_eq!(style_of(&words, None), None);
        let seconds = ["0", "0", "0.5", "0.5", "1"];
        assert_eq!(style_of(&seconds, None), Some(TimeStyle::Number(SECOND)));
    }

    proptest! {
        #[test]
        fn garbage_never_panics(text in ".{0,40}", after in any::<i64>()) {
            let _ = parse_date(&text);
            let _ = style_of(&[&text, &text], None);
            for style in [TimeStyle::Number(SECOND), TimeStyle::Date, TimeStyle::TimeOfDay] {
                let _ = nanoseconds(&text, style, Some(after / 4));
                let _ = clock_of(&text, style);
            }
        }
    }
}
