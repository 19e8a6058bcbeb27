//! `timestamps.txt`: one line a frame of the whole drive, whether or not the frame is there.

use crate::{Error, Result};
use std::path::{Path, PathBuf};

/// Time stamps of a sensor, by frame number.
#[derive(Debug, Clone, PartialEq)]
pub struct TimeStamps {
    /// Nanoseconds since 1970-01-01 00:00; a frame's number is its index. Integers, because an f64 of
    /// seconds since 1970 resolves only a quarter of a microsecond. `None` where the line is empty:
    /// KITTI writes that for frames the sensor missed (drive 0009's scans 177 to 180).
    pub ns: Vec<Option<i64>>,
    path: PathBuf,
}

impl TimeStamps {
    /// Reads a file of lines like `2011-09-26 13:04:32.345808896`, or empty for a frame without a time.
    /// Empty lines at its end are no frames.
    ///
    /// # Errors
    /// [`Error::Missing`] if there is no such file, [`Error::TimeStamp`] with the number of a bad line.
    pub fn read(path: &Path) -> Result<Self> {
        let bytes = std::fs::read(path).map_err(|e| match e.kind() {
            std::io::ErrorKind::NotFound => Error::Missing {
                path: path.to_owned(),
                what: "the time of every frame",
                remedy: "fetch the drive's time stamps: ego-motion uses real time, not a nominal frame rate",
            },
            _ => Error::file(path, e),
        })?;
        let text = String::from_utf8_lossy(&bytes);
        let mut ns = Vec::new();
        for (i, line) in text.trim_end().lines().enumerate() {
            if line.trim().is_empty() {
                ns.push(None);
                continue;
            }
            let time = parse(line).map_err(|problem| Error::TimeStamp {
                path: path.to_owned(),
                line: i + 1,
                problem,
            })?;
            ns.push(Some(time));
        }
        Ok(Self {
            ns,
            path: path.to_owned(),
        })
    }

    /// The first time there is, from which seconds are counted.
    #[must_use]
    pub fn origin_ns(&self) -> Option<i64> {
        self.ns.iter().copied().flatten().next()
    }

    /// Seconds from `origin_ns` to the time of `frame`; `None` where its line is empty.
    ///
    /// # Errors
    /// [`Error::NoTimeStamp`] if the file ends before that frame.
    pub fn seconds(&self, frame: u64, origin_ns: i64) -> Result<Option<f64>> {
        let found = usize::try_from(frame).ok().and_then(|i| self.ns.get(i));
        let ns = found.ok_or_else(|| Error::NoTimeStamp {
            path: self.path.clone(),
            lines: self.ns.len(),
            frame,
        })?;
        Ok(ns.map(|ns| (ns - origin_ns) as f64 * 1e-9))
    }

    /// Seconds from `origin_ns` to the time of every frame.
    #[must_use]
    pub fn all_seconds(&self, origin_ns: i64) -> Vec<Option<f64>> {
        let seconds = |ns: &Option<i64>| ns.map(|ns| (ns - origin_ns) as f64 * 1e-9);
        self.ns.iter().map(seconds).collect()
    }
}

/// [`parse`] for other layouts' lists of times.
pub(crate) fn parse_date_time(line: &str) -> Option<i64> {
    parse(line).ok()
}

/// Nanoseconds since 1970 of `2011-09-26 13:04:32.345808896`; the fraction has 0 to 9 digits.
fn parse(line: &str) -> std::result::Result<i64, String> {
    let shape = || {
        let shown: String = line.chars().take(60).collect();
        format!("'{shown}' is not a time stamp like 2011-09-26 13:04:32.345808896")
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

/// Days from 1970-01-01 in the Gregorian calendar (years counted from March, so that the leap day is
/// a year's last).
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

    fn read(text: &str) -> Result<TimeStamps> {
        let file = tempfile::NamedTempFile::new().unwrap();
        std::fs::write(file.path(), text).unwrap();
        TimeStamps::read(file.path())
    }

    #[test]
    fn nanoseconds_are_kept() {
        // `date -u -d '2011-09-26 13:04:32' +%s` gives 1317042272.
        let times =
            read("2011-09-26 13:04:32.345808896\n2011-09-26 13:04:32.449188864\r\n\n").unwrap();
        assert_eq!(
            times.ns,
            [
                Some(1_317_042_272_345_808_896),
                Some(1_317_042_272_449_188_864)
            ]
        );
        let dt = times
            .seconds(1, times.origin_ns().unwrap())
            .unwrap()
            .unwrap();
        assert!((dt - 0.103_379_968).abs() < 1e-15, "{dt}");
    }

    #[test]
    fn leap_days_and_centuries_count() {
        assert_eq!(days_since_1970(1970, 1, 1), 0);
        assert_eq!(days_since_1970(2000, 2, 29), 11_016);
        assert_eq!(days_since_1970(2100, 3, 1), 47_541);
    }

    #[test]
    fn a_bad_line_is_named_with_its_number() {
        for bad in [
            "soon",
            "2011-09-26",
            "2011-13-26 13:04:32.1",
            "2011-09-26 13:04:32.x",
            "2011-09-26 13:04:32.1234567890",
            "2011-09-26 13:04",
            "-1-2-3 1:2:3",
        ] {
            let text = format!("2011-09-26 13:04:32.3\n{bad}\n2011-09-26 13:04:33.3\n");
            let error = read(&text).unwrap_err();
            assert!(
                matches!(error, Error::TimeStamp { line: 2, .. }),
                "{bad}: {error}"
            );
            assert!(error.to_string().contains(":2:"), "{error}");
        }
    }

    #[test]
    fn an_empty_line_is_a_frame_without_a_time() {
        let times = read("\n2011-09-26 13:04:32.3\n \n2011-09-26 13:04:33.3\n").unwrap();
        let origin = times.origin_ns().unwrap();
        let seconds: Vec<_> = (0..4).map(|n| times.seconds(n, origin).unwrap()).collect();
        assert_eq!(seconds, [None, Some(0.0), None, Some(1.0)]);
    }

    #[test]
    fn a_frame_beyond_the_file_is_named() {
        let times = read("2011-09-26 13:04:32.3\n").unwrap();
        let message = times.seconds(7, 0).unwrap_err().to_string();
        assert!(message.contains("frame 7"), "{message}");
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

        /// Later clock readings are later times, by as much.
        #[test]
        fn times_of_a_day_are_in_order(a in 0i64..86_400, b in 0i64..86_400, ns in 0i64..1_000_000_000) {
            let stamp = |s: i64| parse(&format!("2011-09-26 {:02}:{:02}:{:02}.{ns:09}", s / 3600, s / 60 % 60, s % 60)).unwrap();
            prop_assert_eq!(stamp(b) - stamp(a), (b - a) * 1_000_000_000);
        }
    }
}
