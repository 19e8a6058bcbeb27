//! The text format of Google's GnssLogger: rows of several kinds, with each kind's columns in a comment; `Fix` rows hold the speed.

use crate::error::{BadLine, Error, Result};
use crate::log::{Clock, DriveLog, Format, Speed};
use crate::note::{FixesNote, LogNote};
use crate::numbers::{Cell, cell};
use crate::problem::{LineField, SpeedProblem, TableProblem};
use crate::rows::{Astray, enough, left_out};
use crate::table::short;
use std::path::Path;

const HEADER: &str = "# Fix,";

/// Whether a text has this format.
pub(crate) fn is_one(text: &str) -> bool {
    let mut lines = text.lines().take(1000);
    lines.any(|l| l.starts_with(HEADER) || l.starts_with("Fix,"))
}

/// The speeds of the `Fix` rows. If some come from GPS alone, only these are read: the others are fused with network positions.
pub(crate) fn read(path: &Path, text: &str) -> Result<DriveLog> {
    let header = text.lines().find_map(|l| l.strip_prefix(HEADER));
    let columns: Vec<String> = header
        .unwrap_or("Provider,LatitudeDegrees,LongitudeDegrees,AltitudeMeters,SpeedMps,AccuracyMeters,BearingDegrees,UnixTimeMillis")
        .split(',')
        .map(|c| c.trim().to_lowercase())
        .collect();
    // Older versions used other names.
    let find = |names: [&'static str; 2]| {
        let place = columns.iter().position(|c| names.contains(&c.as_str()));
        place.ok_or_else(|| Error::NoSpeed {
            path: path.to_owned(),
            problem: SpeedProblem::NoFixColumn { column: names[0] },
        })
    };
    let (provider, speed) = (
        find(["provider", "provider"])?,
        find(["speedmps", "speed"])?,
    );
    let time = find(["unixtimemillis", "(utc)timeinms"])?;
    let accuracy = columns.iter().position(|c| c == "speedaccuracymps");
    let fixes = || {
        let rows = text.lines().enumerate();
        rows.filter_map(|(i, l)| {
            Some((
                i as u64 + 1,
                l.strip_prefix("Fix,")?
                    .split(',')
                    .map(str::trim)
                    .collect::<Vec<_>>(),
            ))
        })
    };
    let is_satellite = |row: &[&str]| {
        row.get(provider)
            .is_some_and(|p| p.eq_ignore_ascii_case("gps"))
    };
    let satellites = fixes().any(|(_, row)| is_satellite(&row));
    let (mut found, mut rows, mut absent) = (Vec::new(), 0, 0);
    for (line, row) in fixes() {
        if satellites && !is_satellite(&row) {
            continue;
        }
        rows += 1;
        let number = |index: usize| {
            let word = row.get(index).copied().unwrap_or("");
            match cell(word, false) {
                Cell::Absent => Ok(None),
                Cell::Number(n) => Ok(Some(n)),
                Cell::Other => {
                    let field = LineField::FixColumn(columns[index].clone());
                    let text = short(word);
                    Err(BadLine::new(line, field, TableProblem::NotANumber { text }).of(path))
                }
            }
        };
        let (Some(mps), Some(ms)) = (number(speed)?, number(time)?) else {
            absent += 1;
            continue;
        };
        let sigma = accuracy.map(number).transpose()?.flatten();
        let speed = Speed {
            ns: (ms * 1e6).round() as i64,
            mps,
            sigma_mps: sigma.filter(|s| *s > 0.0),
        };
        found.push((speed.ns, (line, speed)));
    }
    let mut astray = Astray::default();
    let in_order = astray.leave_out(found, |(line, _), back_ns| {
        let back_s = back_ns as f64 * 1e-9;
        let problem = TableProblem::FixBackwards { back_s };
        BadLine::new(*line, "Fix, UnixTimeMillis", problem).of(path)
    });
    let of_order = astray.notes(in_order.len())?;
    let used = in_order.len();
    let mut speeds: Vec<Speed> = in_order.into_iter().map(|(_, (_, speed))| speed).collect();
    // The first of several fixes with the same time.
    speeds.dedup_by_key(|speed| speed.ns);
    let repeated = used - speeds.len();
    let mut notes = vec![LogNote::from(FixesNote::FixRows {
        of_satellites: satellites,
    })];
    left_out(&mut notes, rows, absent, repeated);
    notes.extend(of_order.into_iter().map(LogNote::from));
    enough(path, &speeds)?;
    Ok(DriveLog {
        format: Format::GnssLogger,
        clock: Clock::Date,
        speeds,
        yaw_rates: Vec::new(),
        course_rates: Vec::new(),
        notes,
    })
}
