//! Parses dates with a time of day, as KITTI writes them.

use crate::TimeStampProblem;

/// Nanoseconds since 1970 of `2011-09-26 13:04:32.345808896`; the fraction has 0 to 9 digits.
pub(crate) fn parse(line: &str) -> Result<i64, TimeStampProblem> {
    let shape = || TimeStampProblem::NotADate {
        text: line.chars().take(60).collect(),
    };
    let (date, time) = line.trim().split_once([' ', 'T']).ok_or_else(shape)?;
    let (clock, fraction) = time.trim().split_once('.').unwrap_or((time, ""));
    let whole = |words: Vec<&str>| -> Option<[i64; 3]> {
        let numbers: Vec<i64> = words.iter().map_while(|w| digits(w)).collect();
        (words.len() == 3).then_some(())?;
        numbers.try_into().ok()
    };
    let [year, month, day] = whole(date.split('-').collect()).ok_or_else(shape)?;
    let [hour, minute, second] = whole(clock.split(':').collect()).ok_or_else(shape)?;
    let in_range = (1970..2200).contains(&year)
        && (1..=12).contains(&month)
        && (1..=31).contains(&day)
        && hour < 24
        && minute < 60
        && second <= 60;
    if !in_range || fraction.len() > 9 {
        return Err(shape());
    }
    let nanoseconds = match fraction {
        "" => 0,
        _ => digits(fraction).ok_or_else(shape)? * 10_i64.pow(9 - fraction.len() as u32),
    };
    let seconds = days_since_1970(year, month, day) * 86_400 + hour * 3600 + minute * 60 + second;
    Ok(seconds * 1_000_000_000 + nanoseconds)
}

/// An unsigned number of at most nine digits and nothing else.
fn digits(word: &str) -> Option<i64> {
    let plain = !word.is_empty() && word.len() <= 9 && word.bytes().all(|b| b.is_ascii_digit());
    if plain { word.parse().ok() } else { None }
}

/// Days since 1970-01-01 in the Gregorian calendar (years counted from March, so that the leap day is
/// a year's last day).
fn days_since_1970(year: i64, month: i64, day: i64) -> i64 {
    let y = if month <= 2 { year - 1 } else { year };
    let month_from_march = (month + 9) % 12;
    let day_of_year = (153 * month_from_march + 2) / 5 + day - 1;
    365 * y + y / 4 - y / 100 + y / 400 + day_of_year - 719_468
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn leap_days_and_centuries_count() {
        assert_eq!(days_since_1970(1970, 1, 1), 0);
        assert_eq!(days_since_1970(2000, 2, 29), 11_016);
        assert_eq!(days_since_1970(2100, 3, 1), 47_541);
    }

    proptest! {
        #[test]
        fn garbage_never_panics(text in "[0-9:. T\\-]{0,40}") {
            let _ = parse(&text);
        }

        #[test]
        fn any_text_never_panics(text in ".{0,40}") {
            let _ = parse(&text);
        }

        /// The difference of two times of day is that of the parsed times.
        #[test]
        fn times_of_a_day_are_in_order(a in 0i64..86_400, b in 0i64..86_400, ns in 0i64..1_000_000_000) {
            let stamp = |s: i64| parse(&format!("2011-09-26 {:02}:{:02}:{:02}.{ns:09}", s / 3600, s / 60 % 60, s % 60)).unwrap();
            prop_assert_eq!(stamp(b) - stamp(a), (b - a) * 1_000_000_000);
        }
    }
}
