//! Data goes to stdout, warnings to stderr, runs to `runs/<command>-<time>`.

use std::io::{ErrorKind, Write};
use std::path::{Path, PathBuf};
use std::time::{SystemTime, UNIX_EPOCH};

use crate::failure::{Context, Result};

/// Warnings of all crates on stderr.
pub fn init_logging() {
    tracing_subscriber::fmt()
        .with_max_level(tracing_subscriber::filter::LevelFilter::WARN)
        .with_writer(std::io::stderr)
        .with_ansi(colours_on_stderr())
        .without_time()
        // Else a warning that nobody can read any more ends the program.
        .log_internal_errors(false)
        .with_target(false)
        .init();
}

/// Whether stderr is a terminal that wants colours (`NO_COLOR` is honoured).
fn colours_on_stderr() -> bool {
    anstream::AutoStream::choice(&std::io::stderr()) != anstream::ColorChoice::Never
}

/// Prints data on stdout. A reader that has gone away (`… | head`) is no failure.
pub fn print(text: &str) -> Result<()> {
    let mut out = std::io::stdout().lock();
    match out.write_all(text.as_bytes()).and_then(|()| out.flush()) {
        Err(error) if error.kind() != ErrorKind::BrokenPipe => {
            Err(error).context("cannot write to stdout")
        }
        _ => Ok(()),
    }
}

/// Prints a value as JSON on stdout.
pub fn print_json<T: serde::Serialize + ?Sized>(value: &T) -> Result<()> {
    let text =
        serde_json::to_string_pretty(value).context("the result cannot be written as JSON")?;
    print(&format!("{text}\n"))
}

/// Writes a file, whole or not at all.
pub fn write(path: &Path, bytes: impl AsRef<[u8]>) -> Result<()> {
    let written = deepfusion_fs::write(path, bytes);
    Ok(written.map_err(|e| deepfusion_data::Error::file(path, e))?)
}

/// The same without waiting for the disk: one of many files that something written later calls done.
pub fn write_unsynced(path: &Path, bytes: impl AsRef<[u8]>) -> Result<()> {
    let failed = |e| deepfusion_data::Error::file(path, e);
    Ok(deepfusion_fs::write_unsynced(path, failed, |out| {
        out.write_all(bytes.as_ref()).map_err(failed)
    })?)
}

/// The folder a command writes to: the one asked for, or a new `runs/<command>-<time>`. It is made; a folder that holds
/// something already is refused.
pub fn run_folder(asked: Option<&Path>, command: &str) -> Result<PathBuf> {
    let folder = match asked {
        Some(folder) => folder.to_owned(),
        None => unused(&PathBuf::from("runs").join(format!("{command}-{}", now()))),
    };
    let failed = |e| deepfusion_data::Error::file(&folder, e);
    std::fs::create_dir_all(&folder).map_err(failed)?;
    if std::fs::read_dir(&folder).map_err(failed)?.next().is_some() {
        return Err(crate::error::CliError::Exists {
            path: folder,
            remedy: "choose another folder, or empty this one first",
        }
        .into());
    }
    Ok(folder)
}

/// `path`, or `path-2`, `path-3` … where that is taken.
fn unused(path: &Path) -> PathBuf {
    let numbered = |n: u32| {
        if n == 1 {
            path.to_owned()
        } else {
            PathBuf::from(format!("{}-{n}", path.display()))
        }
    };
    (1..)
        .map(numbered)
        .find(|p| !p.exists())
        .unwrap_or_else(|| path.to_owned())
}

/// Fails where a file could not be written for want of its folder: told before long work, not after it.
pub fn require_folder_of(file: &Path) -> Result<()> {
    match file.parent() {
        Some(folder) if folder != Path::new("") && !folder.is_dir() => {
            let missing = std::io::Error::from(ErrorKind::NotFound);
            Err(deepfusion_data::Error::file(folder, missing).into())
        }
        _ => Ok(()),
    }
}

/// The last part of a path, for people: a folder given as `.` by its own name.
pub fn name_of(path: &Path) -> String {
    let whole = path.canonicalize().unwrap_or_else(|_| path.to_owned());
    let name = whole.file_name().unwrap_or(whole.as_os_str());
    name.to_string_lossy().into_owned()
}

/// The time now (UTC), such as `20260131-235959`.
pub fn now() -> String {
    let seconds = SystemTime::now()
        .duration_since(UNIX_EPOCH)
        .map_or(0, |d| d.as_secs());
    stamp(seconds)
}

/// The day of a time (UTC), such as `2026-01-31`.
pub fn day(time: SystemTime) -> String {
    let seconds = time.duration_since(UNIX_EPOCH).map_or(0, |d| d.as_secs());
    let stamp = stamp(seconds);
    format!("{}-{}-{}", &stamp[..4], &stamp[4..6], &stamp[6..8])
}

/// Seconds since 1970 as `YYYYMMDD-HHMMSS`, UTC, by counting days through the 400-year cycle of the calendar.
fn stamp(seconds: u64) -> String {
    let (days, rest) = (seconds / 86_400, seconds % 86_400);
    // Days from 0000-03-01, so that a leap day is the last of its year.
    let days = days + 719_468;
    let (era, day_of_era) = (days / 146_097, days % 146_097);
    let year_of_era =
        (day_of_era - day_of_era / 1_460 + day_of_era / 36_524 - day_of_era / 146_096) / 365;
    let day_of_year = day_of_era - (365 * year_of_era + year_of_era / 4 - year_of_era / 100);
    let month_from_march = (5 * day_of_year + 2) / 153;
    let day = day_of_year - (153 * month_from_march + 2) / 5 + 1;
    let month = if month_from_march < 10 {
        month_from_march + 3
    } else {
        month_from_march - 9
    };
    let year = era * 400 + year_of_era + u64::from(month <= 2);
    format!(
        "{year:04}{month:02}{day:02}-{:02}{:02}{:02}",
        rest / 3600,
        rest / 60 % 60,
        rest % 60
    )
}

#[cfg(test)]
mod tests {
    use super::*;

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
            assert_eq!(stamp(seconds), expected);
        }
        let leap_day = UNIX_EPOCH + std::time::Duration::from_secs(951_827_696);
        assert_eq!(day(leap_day), "2000-02-29");
    }

    #[test]
    fn nothing_is_overwritten() {
        let folder = tempfile::tempdir().unwrap();
        let run = folder.path().join("run");
        assert_eq!(run_folder(Some(&run), "demo").unwrap(), run);
        assert_eq!(
            run_folder(Some(&run), "demo").unwrap(),
            run,
            "an empty folder may be used"
        );
        std::fs::write(run.join("file"), "x").unwrap();
        assert!(run_folder(Some(&run), "demo").is_err());
        assert_eq!(unused(&run), folder.path().join("run-2"));
    }
}
