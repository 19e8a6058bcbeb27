//! GPX tracks (1.0 and 1.1) of phones, watches and cameras.

use crate::error::{BadLine, Result};
use crate::log::{DriveLog, Format};
use crate::problem::GpxProblem;
use crate::track::{TimedFix, log_of_fixes};
use deepfusion_motion::Fix;
use quick_xml::Reader;
use quick_xml::events::{BytesStart, Event};
use std::path::Path;

/// Reads a track.
pub(crate) fn read(path: &Path) -> Result<DriveLog> {
    let bytes = std::fs::read(path).map_err(|e| crate::Error::file(path, e))?;
    let fixes = fixes(&bytes).map_err(|bad| bad.of(path))?;
    log_of_fixes(path, Format::Gpx, &fixes)
}

/// The points of all tracks of a GPX file (1.0 and 1.1) that have a time, with a speed in m/s from the point or an extension.
fn fixes(bytes: &[u8]) -> std::result::Result<Vec<TimedFix>, BadLine> {
    let mut reader = Reader::from_reader(bytes);
    // Lines are counted from the previous event: a track has millions of events.
    let (mut line, mut counted) = (1, 0);
    let (mut fixes, mut point, mut text, mut known) = (Vec::new(), None, String::new(), false);
    loop {
        let event = reader.read_event();
        let position = match &event {
            Ok(_) => reader.buffer_position(),
            Err(_) => reader.error_position(),
        };
        let position = (position as usize).clamp(counted, bytes.len());
        line += memchr::memchr_iter(b'\n', &bytes[counted..position]).count() as u64;
        counted = position;
        let event = event.map_err(|e| BadLine::new(line, "XML", GpxProblem::from(e)))?;
        match event {
            Event::Start(tag) => {
                known |= tag.local_name().as_ref() == b"gpx";
                if tag.local_name().as_ref() == b"trkpt" {
                    point = Some(Point {
                        line,
                        fix: place(&tag, line)?,
                        ns: None,
                    });
                }
                text.clear();
            }
            Event::Text(part) => text += &String::from_utf8_lossy(&part),
            Event::End(tag) => {
                let name = tag.local_name();
                if name.as_ref() == b"trkpt" {
                    fixes.extend(point.take().and_then(|p| {
                        Some(TimedFix {
                            ns: p.ns?,
                            fix: p.fix,
                        })
                    }));
                } else if let Some(point) = &mut point {
                    match name.as_ref() {
                        b"time" => point.ns = Some(date(text.trim(), point.line)?),
                        b"speed" => point.fix.speed_mps = speed(text.trim(), point.line)?,
                        _ => {}
                    }
                }
            }
            Event::Eof if point.is_some() => {
                return Err(BadLine::new(line, "trkpt", GpxProblem::Cut));
            }
            Event::Eof if !known => {
                return Err(BadLine::new(1, "gpx", GpxProblem::NoGpx));
            }
            Event::Eof => return Ok(fixes),
            _ => {}
        }
    }
}

/// A point that is being read.
struct Point {
    line: u64,
    fix: Fix,
    ns: Option<i64>,
}

fn place(tag: &BytesStart, line: u64) -> std::result::Result<Fix, BadLine> {
    let degrees = |name: &'static str, most: f64| {
        let attribute = tag
            .try_get_attribute(name)
            .map_err(|e| BadLine::new(line, name, GpxProblem::from(e)))?;
        let attribute =
            attribute.ok_or_else(|| BadLine::new(line, name, GpxProblem::NoCoordinate))?;
        let text = String::from_utf8_lossy(&attribute.value).into_owned();
        let value: Option<f64> = text.trim().parse().ok();
        let inside = value.filter(|v| v.abs() <= most);
        inside.ok_or_else(|| BadLine::new(line, name, GpxProblem::Angle { text, most }))
    };
    Ok(Fix {
        time_s: 0.0,
        latitude_deg: degrees("lat", 90.0)?,
        longitude_deg: degrees("lon", 180.0)?,
        speed_mps: None,
    })
}

/// An ISO 8601 date with its zone, in nanoseconds since 1970.
fn date(word: &str, line: u64) -> std::result::Result<i64, BadLine> {
    let stamp: std::result::Result<jiff::Timestamp, _> = word.parse();
    let bad = |problem: GpxProblem| BadLine::new(line, "time", problem);
    let text = || word.to_owned();
    let stamp = stamp.map_err(|source| {
        let text = text();
        bad(GpxProblem::Time { text, source })
    })?;
    i64::try_from(stamp.as_nanosecond()).map_err(|_| bad(GpxProblem::TooLate { text: text() }))
}

/// A speed in m/s; a negative one, as iOS writes it, means unknown.
fn speed(word: &str, line: u64) -> std::result::Result<Option<f64>, BadLine> {
    let value: Option<f64> = word.parse().ok();
    let value = value.filter(|v| v.is_finite() && *v < 200.0);
    let value = value.ok_or_else(|| {
        let text = word.to_owned();
        BadLine::new(line, "speed", GpxProblem::Speed { text })
    })?;
    Ok((value >= 0.0).then_some(value))
}
