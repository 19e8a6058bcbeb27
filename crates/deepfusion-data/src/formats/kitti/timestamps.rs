//! Reads `timestamps.txt`: one line for each frame of the whole drive, whether or not its image exists.

use crate::logs::date_time::parse;
use crate::{Error, MissingPart, Result};
use std::path::{Path, PathBuf};

/// Time stamps of a sensor, by frame number.
#[derive(Debug, Clone, PartialEq)]
pub struct TimeStamps {
    /// Nanoseconds since 1970-01-01 00:00, indexed by frame number. Integers, because an f64 of
    /// seconds since 1970 only has a resolution of a quarter of a microsecond. `None` for an empty line,
    /// which KITTI writes for frames that the sensor missed (drive 0009's scans 177 to 180).
    pub ns: Vec<Option<i64>>,
    /// Number of empty lines after the last time, which stand for frames without a time if such frames exist.
    empty_at_end: usize,
    path: PathBuf,
}

impl TimeStamps {
    /// Reads a file of lines like `2011-09-26 13:04:32.345808896`, or empty lines for frames without a time.
    /// Empty lines at the end only count if there are such frames.
    ///
    /// # Errors
    /// [`Error::Missing`] if there is no such file, [`Error::TimeStamp`] with the number of a bad line.
    pub fn read(path: &Path) -> Result<Self> {
        let bytes = std::fs::read(path).map_err(|e| match e.kind() {
            std::io::ErrorKind::NotFound => Error::Missing {
                path: path.to_owned(),
                part: MissingPart::TimeStamps,
            },
            _ => Error::file(path, e),
        })?;
        let text = String::from_utf8_lossy(&bytes);
        let mut ns = Vec::new();
        let with_times = text.trim_end();
        let empty_at_end = text.lines().count() - with_times.lines().count();
        for (i, line) in with_times.lines().enumerate() {
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
            empty_at_end,
            path: path.to_owned(),
        })
    }

    /// The first time in the file, from which seconds are counted.
    #[must_use]
    pub fn origin_ns(&self) -> Option<i64> {
        self.ns.iter().copied().flatten().next()
    }

    /// Seconds from `origin_ns` to the time of `frame`; `None` if its line is empty.
    ///
    /// # Errors
    /// [`Error::NoTimeStamp`] if the file ends before that frame.
    pub fn seconds(&self, frame: u64, origin_ns: i64) -> Result<Option<f64>> {
        let ns = self.nanoseconds(frame)?;
        Ok(ns.map(|ns| (ns - origin_ns) as f64 * 1e-9))
    }

    /// The time of `frame`, in nanoseconds since 1970; `None` if its line is empty.
    ///
    /// # Errors
    /// [`Error::NoTimeStamp`] if the file ends before that frame.
    pub fn nanoseconds(&self, frame: u64) -> Result<Option<i64>> {
        let index = usize::try_from(frame).unwrap_or(usize::MAX);
        match self.ns.get(index) {
            Some(ns) => Ok(*ns),
            None if index - self.ns.len() < self.empty_at_end => Ok(None),
            None => Err(Error::NoTimeStamp {
                path: self.path.clone(),
                lines: self.ns.len(),
                frame,
            }),
        }
    }

    /// Seconds from `origin_ns` to the time of every frame.
    #[must_use]
    pub fn all_seconds(&self, origin_ns: i64) -> Vec<Option<f64>> {
        let seconds = |ns: &Option<i64>| ns.map(|ns| (ns - origin_ns) as f64 * 1e-9);
        self.ns.iter().map(seconds).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

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
    fn the_last_frame_may_have_no_time() {
        let times = read("2011-09-26 13:04:32.3\n\n").unwrap();
        assert_eq!(times.ns.len(), 1);
        assert_eq!(times.nanoseconds(1).unwrap(), None);
        assert!(times.nanoseconds(2).is_err());
    }

    #[test]
    fn a_frame_beyond_the_file_is_named() {
        let times = read("2011-09-26 13:04:32.3\n").unwrap();
        let message = times.seconds(7, 0).unwrap_err().to_string();
        assert!(message.contains("frame 7"), "{message}");
    }
}
