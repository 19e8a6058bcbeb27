//! Converts times in any unit to whole nanoseconds.

use std::ops::RangeInclusive;

/// Unit of a time in a file.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum TimeUnit {
    Seconds,
    Milliseconds,
    Microseconds,
    Nanoseconds,
}

/// Seconds since 1970 for the years 2000 to 2100. Numbers in this range, in some unit, count as dates.
const EPOCH_S: RangeInclusive<f64> = 9.46e8..=4.102e9;

impl TimeUnit {
    /// The unit with this name in a header or in `dataset.toml`.
    pub(crate) fn named(name: &str) -> Option<Self> {
        match name {
            "s" | "sec" | "second" | "seconds" => Some(Self::Seconds),
            "ms" | "msec" | "milliseconds" => Some(Self::Milliseconds),
            "us" | "usec" | "µs" | "microseconds" => Some(Self::Microseconds),
            "ns" | "nsec" | "nanoseconds" => Some(Self::Nanoseconds),
            _ => None,
        }
    }

    /// The unit's symbol.
    pub(crate) fn symbol(self) -> &'static str {
        match self {
            Self::Seconds => "s",
            Self::Milliseconds => "ms",
            Self::Microseconds => "us",
            Self::Nanoseconds => "ns",
        }
    }

    /// Number of decimal digits from this unit down to nanoseconds.
    fn digits(self) -> usize {
        match self {
            Self::Seconds => 9,
            Self::Milliseconds => 6,
            Self::Microseconds => 3,
            Self::Nanoseconds => 0,
        }
    }

    /// How many of this unit make a second.
    pub(crate) fn per_second(self) -> f64 {
        10_f64.powi(9 - self.digits() as i32)
    }

    /// The unit in which this number is a date between 2000 and 2100.
    pub(crate) fn of_date(number: f64) -> Option<Self> {
        let units = [
            Self::Seconds,
            Self::Milliseconds,
            Self::Microseconds,
            Self::Nanoseconds,
        ];
        let is_date = |u: &Self| EPOCH_S.contains(&(number / 10_f64.powi(9 - u.digits() as i32)));
        units.into_iter().find(is_date)
    }

    /// The likely unit of numbers without one: that in which the first is a date, otherwise seconds if
    /// the median step is at most 1. `None` if ambiguous: steps of 40 could be milliseconds or frames.
    pub(crate) fn of_numbers(numbers: &[f64]) -> Option<Self> {
        let first = *numbers.first()?;
        if let Some(unit) = Self::of_date(first) {
            return Some(unit);
        }
        // Ignore the sign: decreasing times are reported elsewhere.
        let steps = numbers.windows(2).map(|w| (w[1] - w[0]).abs());
        let mut steps: Vec<f64> = steps.collect();
        steps.sort_by(f64::total_cmp);
        let median = *steps.get(steps.len() / 2)?;
        (median > 0.0 && median <= 1.0).then_some(Self::Seconds)
    }

    /// A number in text as nanoseconds, with all digits: an f64 of seconds since 1970 has a resolution of a quarter of a
    /// microsecond. `None` if it is not a number, or beyond 292 years.
    pub(crate) fn nanoseconds(self, word: &str) -> Option<i64> {
        let word = word.trim();
        let (negative, digits) = match word.strip_prefix('-') {
            Some(rest) => (true, rest),
            None => (false, word.strip_prefix('+').unwrap_or(word)),
        };
        let (whole, fraction) = digits.split_once('.').unwrap_or((digits, ""));
        let plain = |s: &str| s.bytes().all(|b| b.is_ascii_digit());
        if !plain(whole) || !plain(fraction) || whole.len() + fraction.len() == 0 {
            // With an exponent, there are no digits to preserve.
            let value = word.parse::<f64>().ok()? * 10_f64.powi(self.digits() as i32);
            return (value.abs() < 9e18).then_some(value.round() as i64);
        }
        let kept = self.digits().min(fraction.len());
        let zeros = (self.digits() - kept) as u32;
        let whole = format!("{whole}{}", &fraction[..kept]);
        let value = whole.parse::<i64>().ok()?;
        let value = value.checked_mul(10_i64.checked_pow(zeros)?)?;
        Some(if negative { -value } else { value })
    }
}

/// Converts a time on the camera's clock, which is `ahead_s` seconds ahead, to the vehicle's clock.
pub(crate) fn on_the_vehicles_clock(ns: i64, ahead_s: f64) -> i64 {
    ns.saturating_sub((ahead_s * 1e9).round() as i64)
}

/// Seconds from `origin_ns` to `ns`.
pub(crate) fn seconds(ns: i64, origin_ns: i64) -> f64 {
    (i128::from(ns) - i128::from(origin_ns)) as f64 * 1e-9
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn the_unit_of_dates_is_recognised() {
        for (number, unit) in [
            (1_317_042_272.345, Some(TimeUnit::Seconds)),
            (1.317_042_272e12, Some(TimeUnit::Milliseconds)),
            (1.317_042_272e15, Some(TimeUnit::Microseconds)),
            (1.403_636_579_763_555_6e18, Some(TimeUnit::Nanoseconds)),
            (46_408.5, None),
            (4.6e13, None),
        ] {
            assert_eq!(TimeUnit::of_date(number), unit, "{number}");
        }
    }

    #[test]
    fn small_steps_are_seconds_and_larger_ones_are_ambiguous() {
        assert_eq!(
            TimeUnit::of_numbers(&[0.0, 0.1, 0.2]),
            Some(TimeUnit::Seconds)
        );
        assert_eq!(
            TimeUnit::of_numbers(&[5.0, 6.0, 7.0]),
            Some(TimeUnit::Seconds)
        );
        assert_eq!(TimeUnit::of_numbers(&[0.0, 40.0, 80.0]), None);
        assert_eq!(TimeUnit::of_numbers(&[0.0]), None);
    }

    #[test]
    fn every_digit_is_kept() {
        let s = TimeUnit::Seconds;
        assert_eq!(
            s.nanoseconds("1317042272.345808896"),
            Some(1_317_042_272_345_808_896)
        );
        assert_eq!(s.nanoseconds(" -0.5 "), Some(-500_000_000));
        assert_eq!(s.nanoseconds("1.3e9"), Some(1_300_000_000_000_000_000));
        assert_eq!(s.nanoseconds(".25"), Some(250_000_000));
        let us = TimeUnit::Microseconds;
        assert_eq!(us.nanoseconds("12.5"), Some(12_500));
        for bad in ["", ".", "x", "1.2.3", "nan", "99999999999999999999", "inf"] {
            assert_eq!(s.nanoseconds(bad), None, "{bad}");
        }
    }

    proptest! {
        #[test]
        fn garbage_never_panics(text in ".{0,30}") {
            for unit in [TimeUnit::Seconds, TimeUnit::Nanoseconds] {
                let _ = unit.nanoseconds(&text);
            }
        }

        #[test]
        fn nanoseconds_survive_being_written_as_seconds(ns in 0i64..4_000_000_000_000_000_000) {
            let text = format!("{}.{:09}", ns / 1_000_000_000, ns % 1_000_000_000);
            prop_assert_eq!(TimeUnit::Seconds.nanoseconds(&text), Some(ns));
        }
    }
}
