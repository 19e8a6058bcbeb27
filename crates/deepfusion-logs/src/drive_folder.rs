//! Writes a log with its video or images as a folder that every command reads: `speed.csv`, `imu.csv` or `course.csv`, `dataset.toml`.

use crate::error::{Error, Result};
use crate::log::{Clock, DriveLog, Speed};
use crate::note::{ClockNote, LogNote};
use deepfusion_fs::{PartialFolder, write_atomically};
use std::fmt::Write as _;
use std::io::{ErrorKind, Write as _};
use std::path::{Path, PathBuf};

/// The parts of a drive's folder.
#[derive(Debug, Clone, PartialEq)]
pub struct DriveFolder<'a> {
    /// The log of speeds, with turns if it has some.
    pub log: &'a DriveLog,
    /// The video or images of the drive.
    pub media: Media,
    /// The camera's calibration file, or its intrinsics.
    pub camera: Option<Camera>,
    /// Time of the first frame on the log's clock, in nanoseconds; if `None`, the video's creation time or the frames' own times give it.
    pub start_ns: Option<i64>,
    /// How far the camera's clock is ahead of the log's, in seconds, if it is known.
    pub camera_ahead_s: Option<f64>,
}

/// The video or images of a drive. The folder refers to them by their absolute path; nothing is copied.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Media {
    /// Path of a video.
    Video(PathBuf),
    /// Path of a folder of images.
    Images(PathBuf),
}

/// How the camera is described.
#[derive(Debug, Clone, PartialEq)]
pub enum Camera {
    /// Path of a calibration file.
    File(PathBuf),
    /// fx, fy, cx, cy in pixels.
    Intrinsics([f64; 4]),
    /// The horizontal field of view, in degrees.
    Hfov(f64),
}

/// Longest time from a log's zero to its beginning for which its zero is taken as the first frame's time.
const NEAR_START_NS: i64 = 5_000_000_000;

impl DriveFolder<'_> {
    /// Files that a folder may contain, `dataset.toml` the last.
    pub const FILES: [&'static str; 4] = ["speed.csv", "imu.csv", "course.csv", "dataset.toml"];

    /// Checks that [`Self::write`] would write into a folder: the clocks are connected, and none of its files exists yet.
    ///
    /// # Errors
    /// [`Error::NoStart`], [`Error::Exists`] as [`Self::write`].
    pub fn check(&self, out: &Path) -> Result<()> {
        self.start()?;
        match Self::FILES
            .map(|name| out.join(name))
            .into_iter()
            .find(|path| path.exists())
        {
            Some(path) => Err(Error::Exists { path }),
            None => Ok(()),
        }
    }

    /// Writes the folder's files, `dataset.toml` the last; the folder is created if it does not exist. Returns notes on what was
    /// assumed.
    ///
    /// # Errors
    /// [`Error::NoStart`] if nothing connects the log's clock with the video's; [`Error::Exists`] if the folder has files with these
    /// names; [`Error::File`].
    pub fn write(&self, out: &Path) -> Result<Vec<LogNote>> {
        self.check(out)?;
        self.write_into(out, out)
    }

    /// Writes the files of the drive `of` into a folder.
    fn write_into(&self, folder: &Path, of: &Path) -> Result<Vec<LogNote>> {
        let (start_ns, notes) = self.start()?;
        let files = Self::FILES.map(|name| folder.join(name));
        std::fs::create_dir_all(folder).map_err(|e| Error::file(folder, e))?;
        let [speed, imu, course, config] = &files;
        save(speed, &speeds(&self.log.speeds))?;
        if !self.log.yaw_rates.is_empty() {
            let mut text = String::from("time_s,yaw_rate_radps\n");
            for reading in &self.log.yaw_rates {
                let _ = writeln!(text, "{},{:.7}", seconds(reading.ns), reading.radps);
            }
            save(imu, &text)?;
        } else if !self.log.course_rates.is_empty() {
            let mut text = String::from("time_s,course_rate_radps\n");
            for reading in &self.log.course_rates {
                let _ = writeln!(text, "{},{:.7}", seconds(reading.ns), reading.radps);
            }
            save(course, &text)?;
        }
        save(config, &self.config(of, start_ns)?)?;
        Ok(notes)
    }

    /// Calls `measure` to find how far the camera's clock is ahead of the log's, in seconds, and writes the folder with that offset. It
    /// measures on a folder beside it with another name, so that a run that is stopped leaves nothing that looks finished. Frames that
    /// were decoded meanwhile are in the final folder; if that did not exist before and nothing was measured, they are removed with it.
    ///
    /// # Errors
    /// As [`Self::write`], and those of `measure`.
    pub fn write_measured<E: From<Error>>(
        &mut self,
        out: &Path,
        measure: impl FnOnce(&Path) -> std::result::Result<Option<f64>, E>,
    ) -> std::result::Result<Vec<LogNote>, E> {
        self.check(out)?;
        // `.` has no name of its own.
        let whole = std::path::absolute(out).map_err(|e| Error::file(out, e))?;
        let trial = PartialFolder::beside(&whole).map_err(|e| Error::file(out, e))?;
        // With the drive's own name, which errors contain.
        let name = whole.file_name().unwrap_or("drive".as_ref());
        let folder = trial.path().join(name);
        std::fs::create_dir(&folder).map_err(|e| Error::file(&folder, e))?;
        link_files(out, &folder)?;
        self.write_into(&folder, out)?;
        let was_there = out.exists();
        self.camera_ahead_s = measure(&folder).inspect_err(|_| {
            if let (false, Media::Video(video)) = (was_there, &self.media) {
                remove_frames(out, video);
            }
        })?;
        drop(trial);
        Ok(self.write(out)?)
    }

    /// The time of the first frame, if the log's clock or the user gives it.
    fn start(&self) -> Result<(Option<i64>, Vec<LogNote>)> {
        if self.start_ns.is_some() {
            return Ok((self.start_ns, Vec::new()));
        }
        let first = self.log.speeds.first().map_or(0, |s| s.ns);
        match (self.log.clock, &self.media) {
            (Clock::LocalDate, Media::Video(_)) => Ok((None, vec![ClockNote::NoZone.into()])),
            (Clock::LocalDate, Media::Images(_)) => Ok((None, vec![ClockNote::LocalDates.into()])),
            (Clock::Video, _) | (Clock::Date, _) | (_, Media::Images(_)) => Ok((None, Vec::new())),
            (Clock::Free, Media::Video(_)) if (0..NEAR_START_NS).contains(&first) => {
                Ok((None, vec![ClockNote::OwnStart.into()]))
            }
            (Clock::Free | Clock::TimeOfDay, Media::Video(_)) => Err(Error::NoStart {
                first_ns: first,
                time_of_day: self.log.clock == Clock::TimeOfDay,
            }),
        }
    }

    fn config(&self, out: &Path, start_ns: Option<i64>) -> Result<String> {
        let whole = |path: &Path| std::path::absolute(path).map_err(|e| Error::file(path, e));
        let mut text = String::from(concat!(
            "# Written from a log. Every key: ",
            env!("CARGO_PKG_REPOSITORY"),
            "/blob/main/docs/reference/dataset-toml.md\n"
        ));
        match &self.media {
            Media::Video(video) => {
                let _ = writeln!(text, "video = {}", quoted(&whole(video)?));
                // The frames decoded from it belong in this folder, not beside a video that may be somebody else's.
                let _ = writeln!(text, "cache = {}", quoted(&whole(out)?));
            }
            Media::Images(images) => {
                let _ = writeln!(text, "images = {}", quoted(&whole(images)?));
            }
        }
        match &self.camera {
            Some(Camera::File(file)) => {
                let _ = writeln!(text, "calibration = {}", quoted(&whole(file)?));
            }
            Some(Camera::Intrinsics(numbers)) => {
                let _ = writeln!(text, "intrinsics = {numbers:?}");
            }
            Some(Camera::Hfov(degrees)) => {
                let _ = writeln!(text, "hfov_deg = {degrees:?}");
            }
            None => {}
        }
        if let Some(ns) = start_ns {
            let _ = writeln!(text, "start_s = {}", seconds(ns));
        }
        if let Some(ahead_s) = self.camera_ahead_s {
            let _ = writeln!(text, "\n[clock]\ncamera_ahead_s = {ahead_s:?}");
        }
        Ok(text)
    }
}

/// Links the files of an existing folder into another: the images' times, or its calibration.
fn link_files(from: &Path, to: &Path) -> Result<()> {
    let entries = match std::fs::read_dir(from) {
        Ok(entries) => entries,
        Err(e) if e.kind() == ErrorKind::NotFound => return Ok(()),
        Err(e) => return Err(Error::file(from, e)),
    };
    for entry in entries {
        let file = entry.map_err(|e| Error::file(from, e))?.path();
        let Some(name) = file.file_name().filter(|_| file.is_file()) else {
            continue;
        };
        let place = to.join(name);
        // A video must not be copied for this; file systems without links are rare.
        let linked = std::fs::hard_link(&file, &place);
        let copied = linked.or_else(|_| std::fs::copy(&file, &place).map(|_| ()));
        copied.map_err(|e| Error::file(&file, e))?;
    }
    Ok(())
}

/// Removes a folder that contains a video's decoded frames and nothing else. If another process has added files meanwhile, all of it stays.
fn remove_frames(folder: &Path, video: &Path) {
    let video = video.file_name().unwrap_or_default().to_string_lossy();
    let begin = format!("{video}-");
    let entries = std::fs::read_dir(folder).into_iter().flatten().flatten();
    let found: Vec<PathBuf> = entries.map(|entry| entry.path()).collect();
    let are_its_frames = |path: &PathBuf| {
        let name = path.file_name().unwrap_or_default().to_string_lossy();
        let named = name.starts_with(&begin) && path.extension().is_some_and(|e| e == "frames");
        named && path.is_dir()
    };
    if found.iter().all(are_its_frames) {
        for frames in found {
            let _ = std::fs::remove_dir_all(frames);
        }
        // Fails if files were added by now.
        let _ = std::fs::remove_dir(folder);
    }
}

/// The table of speeds, with their standard deviations if all have one.
fn speeds(readings: &[Speed]) -> String {
    let sure = readings.iter().all(|reading| reading.sigma_mps.is_some());
    let mut text = String::from("time_s,speed_mps");
    text += if sure { ",speed_sigma_mps\n" } else { "\n" };
    for reading in readings {
        let _ = write!(text, "{},{:.6}", seconds(reading.ns), reading.mps);
        if let Some(sigma) = reading.sigma_mps.filter(|_| sure) {
            let _ = write!(text, ",{sigma:.4}");
        }
        text.push('\n');
    }
    text
}

/// A TOML string.
fn quoted(path: &Path) -> String {
    let mut text = String::from("\"");
    for character in path.to_string_lossy().chars() {
        match character {
            '"' | '\\' => text.extend(['\\', character]),
            c if c.is_control() => {
                let _ = write!(text, "\\u{:04X}", u32::from(c));
            }
            c => text.push(c),
        }
    }
    text + "\""
}

/// Nanoseconds as seconds, exact to the last digit.
fn seconds(ns: i64) -> String {
    let (sign, ns) = (if ns < 0 { "-" } else { "" }, ns.unsigned_abs());
    format!("{sign}{}.{:09}", ns / 1_000_000_000, ns % 1_000_000_000)
}

fn save(path: &Path, text: &str) -> Result<()> {
    let failed = |source| Error::file(path, source);
    write_atomically(path, failed, |file| {
        file.write_all(text.as_bytes()).map_err(failed)
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Format;

    fn log(clock: Clock, first_ns: i64) -> DriveLog {
        let speed = |i: i64| Speed {
            ns: first_ns + i * 500_000_000,
            mps: 8.0,
            sigma_mps: None,
        };
        DriveLog {
            format: Format::Table,
            clock,
            speeds: (0..4).map(speed).collect(),
            yaw_rates: Vec::new(),
            course_rates: Vec::new(),
            notes: Vec::new(),
        }
    }

    fn folder(log: &DriveLog, start_ns: Option<i64>) -> DriveFolder<'_> {
        DriveFolder {
            log,
            media: Media::Video("a \"b\".mp4".into()),
            camera: Some(Camera::Intrinsics([500.0, 500.0, 320.0, 240.0])),
            start_ns,
            camera_ahead_s: None,
        }
    }

    #[test]
    fn a_clock_unrelated_to_the_videos_is_refused() {
        let out = tempfile::tempdir().unwrap();
        for (clock, first_ns, fine) in [
            (Clock::Free, 200_000_000, true),
            (Clock::Free, 43_200_000_000_000, false),
            (Clock::TimeOfDay, 1_000_000_000, false),
            (Clock::Date, 1_777_636_800_000_000_000, true),
            (Clock::Video, 0, true),
        ] {
            let log = log(clock, first_ns);
            let target = out.path().join(format!("{clock:?}-{first_ns}"));
            let written = folder(&log, None).write(&target);
            assert_eq!(written.is_ok(), fine, "{clock:?} {written:?}");
            assert_eq!(
                target.exists(),
                fine,
                "a refused folder leaves nothing behind"
            );
            let target = target.with_extension("given");
            folder(&log, Some(first_ns)).write(&target).unwrap();
        }
    }

    #[test]
    fn a_time_of_day_is_printed_as_one() {
        let target = Path::new("nowhere");
        let log = log(Clock::TimeOfDay, 36_061_500_000_000);
        let error = folder(&log, None).check(target).unwrap_err().to_string();
        assert!(error.contains("begin at 10:01:01, and"), "{error}");
    }

    /// The written table does not mention the time zone.
    #[test]
    fn dates_without_a_zone_give_a_note() {
        let out = tempfile::tempdir().unwrap();
        let images = || Media::Images("images".into());
        for (name, clock, media, expected) in [
            ("a", Clock::LocalDate, images(), Some(ClockNote::LocalDates)),
            ("b", Clock::Date, images(), None),
            (
                "c",
                Clock::LocalDate,
                Media::Video("a.mp4".into()),
                Some(ClockNote::NoZone),
            ),
        ] {
            let log = log(clock, 1_777_636_800_000_000_000);
            let drive = DriveFolder {
                media,
                ..folder(&log, None)
            };
            let notes = drive.write(&out.path().join(name)).unwrap();
            let expected: Vec<LogNote> = expected.into_iter().map(LogNote::from).collect();
            assert_eq!(notes, expected, "{name}");
        }
    }

    #[test]
    fn the_folder_that_is_measured_on_has_all_files() {
        let at = tempfile::tempdir().unwrap();
        let out = at.path().join("drive");
        std::fs::create_dir(&out).unwrap();
        std::fs::write(out.join("frames.csv"), "time_s,file\n").unwrap();
        let log = log(Clock::Date, 1_777_636_800_000_000_000);
        let mut drive = folder(&log, None);
        let stopped: Result<Vec<LogNote>> = drive.write_measured(&out, |trial| {
            let there = |name: &str| trial.join(name).is_file();
            assert!(there("frames.csv") && there("speed.csv") && there("dataset.toml"));
            assert!(
                !out.join("dataset.toml").exists(),
                "the folder looks finished"
            );
            Err(Error::NoStart {
                first_ns: 0,
                time_of_day: false,
            })
        });
        assert!(stopped.is_err());
        let left = || std::fs::read_dir(at.path()).unwrap().count();
        assert_eq!((left(), std::fs::read_dir(&out).unwrap().count()), (1, 1));
        let written: Result<Vec<LogNote>> = drive.write_measured(&out, |_| Ok(Some(0.25)));
        written.unwrap();
        let config = std::fs::read_to_string(out.join("dataset.toml")).unwrap();
        assert!(config.contains("camera_ahead_s = 0.25"), "{config}");
        assert_eq!(left(), 1);
    }

    #[test]
    fn a_failed_measurement_removes_the_folder_unless_it_has_other_files() {
        let at = tempfile::tempdir().unwrap();
        let out = at.path().join("drive");
        let log = log(Clock::Date, 1_777_636_800_000_000_000);
        let refused_with = |files: &[&str]| {
            let media = Media::Video("a.mp4".into());
            let mut drive = DriveFolder {
                media,
                ..folder(&log, None)
            };
            let refused: Result<Vec<LogNote>> = drive.write_measured(&out, |_| {
                for file in files.iter().map(|file| out.join(file)) {
                    std::fs::create_dir_all(file.parent().unwrap()).unwrap();
                    std::fs::write(file, "").unwrap();
                }
                Err(Error::NoStart {
                    first_ns: 0,
                    time_of_day: false,
                })
            });
            refused.unwrap_err();
        };
        let frame = "a.mp4-0.frames/0000000000.jpg";
        refused_with(&[frame]);
        assert_eq!(std::fs::read_dir(at.path()).unwrap().count(), 0);
        // Files of a user, or written there by another process.
        for other in ["notes.txt", "dataset.toml.bak", "my.frames/0.jpg"] {
            refused_with(&[frame, other]);
            assert!(out.join(frame).is_file() && out.join(other).is_file());
            std::fs::remove_dir_all(&out).unwrap();
        }
    }

    #[test]
    fn files_keep_every_digit_and_are_not_overwritten() {
        let out = tempfile::tempdir().unwrap();
        let log = log(Clock::Date, 1_777_636_800_123_456_789);
        let notes = folder(&log, Some(-1_500_000_000))
            .write(out.path())
            .unwrap();
        assert!(notes.is_empty());
        let speeds = std::fs::read_to_string(out.path().join("speed.csv")).unwrap();
        assert!(
            speeds.starts_with("time_s,speed_mps\n1777636800.123456789,8.000000\n"),
            "{speeds}"
        );
        assert!(!out.path().join("imu.csv").exists());
        let config = std::fs::read_to_string(out.path().join("dataset.toml")).unwrap();
        assert!(config.contains("a \\\"b\\\".mp4\"\n"), "{config}");
        assert!(config.contains("start_s = -1.500000000\n"), "{config}");
        let again = folder(&log, None).write(out.path()).unwrap_err();
        assert!(
            again.to_string().contains("speed.csv: already exists"),
            "{again}"
        );
    }
}
