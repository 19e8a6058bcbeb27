//! The format of a file: from its name, its content, and what the user says about it.

use crate::error::{ColumnProblem, Error, Result};
use crate::log::{Clock, DriveLog, ReadOptions};
use crate::note::{ClockNote, LogNote};
use crate::rows::text_of;
use crate::table::Table;
use crate::{can_trace, export_folder, gnss_logger, gpmf, gpx, receiver, tall_table, wide_table};
use std::io::Read as _;
use std::path::{Path, PathBuf};

/// Bytes of a file that show whether its first line is one of candump's.
const BEGINNING: u64 = 4096;

/// Whether a file is named like a GPS track: `.gpx` or `.nmea`.
#[must_use]
pub fn is_gps_track(path: &Path) -> bool {
    ["gpx", "nmea"].contains(&extension(path).as_str())
}

/// Whether a file is a video of a kind that may contain a log of the camera's own, like a GoPro's; [`read`] shows whether it does.
#[must_use]
pub fn may_hold_log(path: &Path) -> bool {
    ["mp4", "mov", "360", "lrv"].contains(&extension(path).as_str())
}

/// Whether a file is a CAN trace: only these need a DBC file. `false` for a file that cannot be read.
#[must_use]
pub fn is_can_trace(path: &Path) -> bool {
    path.is_file()
        && !may_hold_log(path)
        && (extension(path) == "asc"
            || can_trace::is_blf(path).unwrap_or(false)
            || begins_as_candump(path).unwrap_or(false))
}

/// Whether the first line of a file is one of candump's. Only the beginning is read, as a trace may have gigabytes.
fn begins_as_candump(path: &Path) -> std::io::Result<bool> {
    let mut beginning = Vec::new();
    let file = std::fs::File::open(path)?;
    file.take(BEGINNING).read_to_end(&mut beginning)?;
    let text = String::from_utf8_lossy(&beginning);
    Ok(can_trace::is_candump(first_line(&text)))
}

/// Reads several logs of one drive: the speeds of the first, with the turns of the first that has some. The columns named in the options
/// must be in the first, and are used in the others if they have them. `zone_s`: how far the clocks of logs without a time zone are ahead
/// of UTC, in seconds, if that is given. `None` for no log at all; else the log with the first one's own clock, as it was before it was
/// converted to UTC.
///
/// # Errors
/// As [`read`]; [`crate::Error::OtherClock`] if the turns are on a different kind of clock from the speeds.
pub fn read_all(
    paths: &[PathBuf],
    options: &ReadOptions,
    zone_s: Option<i64>,
) -> Result<Option<(DriveLog, Clock)>> {
    let mut merged: Option<(DriveLog, Clock)> = None;
    for path in paths {
        let log = match read(path, options) {
            // Columns of the log that gives the speeds.
            Err(Error::Column {
                problem: ColumnProblem::Missing(_),
                ..
            }) if merged.is_some() => read(path, &options.without_columns())?,
            read => read?,
        };
        let own = log.clock;
        let log = match zone_s {
            Some(ahead_s) => log.in_zone(ahead_s),
            None => log,
        };
        match &mut merged {
            None => merged = Some((log, own)),
            Some((first, _)) if first.yaw_rates.is_empty() && !log.yaw_rates.is_empty() => {
                // Dates without a zone are taken as UTC, if none is given.
                let of_dates = |clock| matches!(clock, Clock::Date | Clock::LocalDate);
                let both_dates = of_dates(first.clock) && of_dates(log.clock);
                if first.clock != log.clock && !both_dates {
                    return Err(Error::OtherClock { path: path.clone() });
                }
                if log.clock == Clock::Free {
                    first.notes.push(ClockNote::SameStart.into());
                }
                // If both lack a zone, the note for the speeds is enough.
                if log.clock == Clock::LocalDate && first.clock != log.clock {
                    first.notes.push(of_file(path, ClockNote::LocalDates));
                }
                first.yaw_rates = log.yaw_rates;
                first.notes.extend(log.notes);
            }
            Some(_) => {}
        }
    }
    Ok(merged)
}

/// Notes on one of several logs.
fn of_file(path: &Path, note: ClockNote) -> LogNote {
    let name = path.file_name().unwrap_or_default();
    LogNote::OfFile {
        file: name.to_string_lossy().into_owned(),
        note: Box::new(note.into()),
    }
}

/// Reads a log.
///
/// # Errors
/// [`crate::Error::File`]; [`crate::Error::Column`] if it is not known which column is meant or what its unit is; [`crate::Error::Line`]
/// and [`crate::Error::Bytes`] for content that cannot be read; [`crate::Error::NoSpeed`] for a file of unknown format, or without a speed;
/// [`crate::Error::Signal`] and [`crate::Error::Motion`] for a CAN trace.
pub fn read(path: &Path, options: &ReadOptions) -> Result<DriveLog> {
    if path.is_dir() {
        return export_folder::read(path, options);
    }
    if may_hold_log(path) {
        return gpmf::read(path);
    }
    match extension(path).as_str() {
        "gpx" => return gpx::read(path),
        "nmea" => return receiver::read(path),
        "asc" => return can_trace::read(path, options),
        _ if can_trace::is_blf(path)? => return can_trace::read(path, options),
        _ => {}
    }
    let text = text_of(path)?;
    let first = first_line(&text);
    if first.starts_with('$') {
        receiver::read(path)
    } else if first.starts_with("<?xml") || first.starts_with("<gpx") {
        gpx::read(path)
    } else if can_trace::is_candump(first) {
        can_trace::read(path, options)
    } else if gnss_logger::is_one(&text) {
        gnss_logger::read(path, &text)
    } else {
        let table = Table::parse(path, &text, 1)?;
        if tall_table::is_one(&table) {
            tall_table::read(&table, options)
        } else {
            wide_table::read(&table, options)
        }
    }
}

/// The first line that is not empty, without a byte order mark.
fn first_line(text: &str) -> &str {
    let mut lines = text.lines().map(str::trim);
    let first = lines.find(|line| !line.is_empty()).unwrap_or("");
    first.trim_start_matches('\u{feff}')
}

fn extension(path: &Path) -> String {
    path.extension()
        .unwrap_or_default()
        .to_string_lossy()
        .to_ascii_lowercase()
}
