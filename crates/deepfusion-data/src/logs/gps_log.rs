//! Tracks of satellite receivers: GPX of phones, watches and cameras; NMEA sentences as receivers speak them.

use super::clock::seconds;
use crate::dataset_toml::FolderConfig;
use crate::{Error, Result};
use deepfusion_motion::{Fix, FixSpeed, speeds_of_fixes};
use nmea::sentences::rmc::{RmcStatusOfFix, parse_rmc};
use quick_xml::Reader;
use quick_xml::events::{BytesStart, Event};
use std::path::{Path, PathBuf};

/// m/s of a knot.
const KNOT_MPS: f64 = 1852.0 / 3600.0;
/// Endings of the files that are taken for tracks.
const ENDINGS: [&str; 2] = ["gpx", "nmea"];

/// Whether a file is named like a track.
pub(crate) fn is_gps(path: &Path) -> bool {
    let extension = path.extension().and_then(|e| e.to_str()).unwrap_or("");
    ENDINGS.contains(&extension.to_ascii_lowercase().as_str())
}

/// The only track of a folder.
///
/// # Errors
/// [`Error::Config`] where there are several, [`Error::File`].
pub(crate) fn in_folder(folder: &Path, config: &FolderConfig) -> Result<Option<PathBuf>> {
    let mut tracks = Vec::new();
    for entry in std::fs::read_dir(folder).map_err(|e| Error::file(folder, e))? {
        let path = entry.map_err(|e| Error::file(folder, e))?.path();
        if path.is_file() && is_gps(&path) {
            tracks.push(path);
        }
    }
    match tracks.len() {
        0 | 1 => Ok(tracks.pop()),
        n => Err(config.error(format!(
            "{n} tracks are there (.gpx, .nmea): name one, speed = \"…\""
        ))),
    }
}

/// A track's speeds.
pub(crate) struct GpsLog {
    /// In nanoseconds since 1970.
    pub(crate) ns: Vec<i64>,
    pub(crate) speeds: Vec<FixSpeed>,
    /// Fixes of the file, also those without a speed.
    pub(crate) fixes: usize,
    /// Whether the receiver told its speed everywhere.
    pub(crate) measured: bool,
}

impl GpsLog {
    /// # Errors
    /// [`Error::File`]; [`Error::Log`] for what is not of the format, or a place or time that cannot be; where there are fewer than
    /// two fixes with a time.
    pub(crate) fn read(path: &Path) -> Result<Self> {
        let bytes = std::fs::read(path).map_err(|e| Error::file(path, e))?;
        let is_xml = path
            .extension()
            .is_some_and(|e| e.eq_ignore_ascii_case("gpx"));
        let parsed = if is_xml {
            gpx(&bytes)
        } else {
            sentences(&bytes)
        };
        let timed = parsed.map_err(
            |Bad {
                 line,
                 field,
                 problem,
             }| Error::Log {
                path: path.to_owned(),
                line,
                field,
                problem,
            },
        )?;
        let origin = timed.first().map_or(0, |(ns, _)| *ns);
        let fixes: Vec<Fix> = timed
            .iter()
            .map(|(ns, fix)| Fix {
                time_s: seconds(*ns, origin),
                ..*fix
            })
            .collect();
        let speeds = speeds_of_fixes(&fixes);
        if speeds.len() < 2 {
            return Err(Error::Log {
                path: path.to_owned(),
                line: 1,
                field: "track".into(),
                problem: format!(
                    "{} fixes with a time, at least two in ten seconds are needed",
                    fixes.len()
                ),
            });
        }
        let ns = speeds
            .iter()
            .map(|s| origin + (s.time_s * 1e9).round() as i64);
        Ok(Self {
            ns: ns.collect(),
            fixes: fixes.len(),
            measured: fixes.iter().all(|f| f.speed_mps.is_some()),
            speeds,
        })
    }
}

/// What is wrong, and where.
struct Bad {
    line: u64,
    field: String,
    problem: String,
}

fn bad(line: u64, field: &str, problem: impl Into<String>) -> Bad {
    Bad {
        line,
        field: field.into(),
        problem: problem.into(),
    }
}

type Timed = Vec<(i64, Fix)>;

/// The points of all tracks of a GPX file (1.0 and 1.1) that have a time; a speed in m/s, of the point or of an extension.
fn gpx(bytes: &[u8]) -> std::result::Result<Timed, Bad> {
    let mut reader = Reader::from_reader(bytes);
    // Lines are counted on from the event before: a track has millions of events.
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
        let event = event.map_err(|e| bad(line, "XML", e.to_string()))?;
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
                    fixes.extend(point.take().and_then(|p| Some((p.ns?, p.fix))));
                } else if let Some(point) = &mut point {
                    match name.as_ref() {
                        b"time" => point.ns = Some(date(text.trim(), point.line)?),
                        b"speed" => point.fix.speed_mps = Some(speed(text.trim(), point.line)?),
                        _ => {}
                    }
                }
            }
            Event::Eof if point.is_some() => {
                return Err(bad(line, "trkpt", "the file ends within it"));
            }
            Event::Eof if !known => {
                return Err(bad(1, "gpx", "no such element: it is no GPX file"));
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

fn place(tag: &BytesStart, line: u64) -> std::result::Result<Fix, Bad> {
    let degrees = |name: &str, most: f64| {
        let attribute = tag
            .try_get_attribute(name)
            .map_err(|e| bad(line, name, e.to_string()))?;
        let attribute = attribute.ok_or_else(|| bad(line, name, "the point has none"))?;
        let word = String::from_utf8_lossy(&attribute.value).into_owned();
        let value: Option<f64> = word.trim().parse().ok();
        let inside = value.filter(|v| v.abs() <= most);
        inside.ok_or_else(|| {
            bad(
                line,
                name,
                format!("'{word}' is no angle up to {most} degrees"),
            )
        })
    };
    Ok(Fix {
        time_s: 0.0,
        latitude_deg: degrees("lat", 90.0)?,
        longitude_deg: degrees("lon", 180.0)?,
        speed_mps: None,
    })
}

/// An ISO 8601 date with its zone, in nanoseconds since 1970.
fn date(word: &str, line: u64) -> std::result::Result<i64, Bad> {
    let stamp: std::result::Result<jiff::Timestamp, _> = word.parse();
    let stamp = stamp.map_err(|e| bad(line, "time", format!("'{word}': {e}")))?;
    i64::try_from(stamp.as_nanosecond())
        .map_err(|_| bad(line, "time", format!("'{word}' is beyond 2262")))
}

fn speed(word: &str, line: u64) -> std::result::Result<f64, Bad> {
    let value: Option<f64> = word.parse().ok();
    let value = value.filter(|v| v.is_finite() && (0.0..200.0).contains(v));
    value.ok_or_else(|| bad(line, "speed", format!("'{word}' is no speed in m/s")))
}

/// The fixes of RMC sentences, whose checksums are tested; other sentences, and what is between them, are passed over.
fn sentences(bytes: &[u8]) -> std::result::Result<Timed, Bad> {
    let (mut fixes, mut known) = (Vec::new(), false);
    for (index, line) in bytes.split(|b| *b == b'\n').enumerate() {
        let number = index as u64 + 1;
        let line = line.trim_ascii();
        let Some(start) = memchr::memchr(b'$', line) else {
            continue;
        };
        let Ok(text) = std::str::from_utf8(&line[start..]) else {
            continue;
        };
        // Sentences are ASCII; anything else between them is noise.
        if !text.is_ascii() || text.len() < 7 {
            continue;
        }
        known = true;
        if &text[3..6] != "RMC" {
            continue;
        }
        let sentence =
            nmea::parse_nmea_sentence(text).map_err(|e| bad(number, "RMC", e.to_string()))?;
        if sentence.checksum != sentence.calc_checksum() {
            let problem = format!(
                "the checksum is {:02X}, not {:02X}",
                sentence.calc_checksum(),
                sentence.checksum
            );
            return Err(bad(number, "RMC", problem));
        }
        let rmc = parse_rmc(sentence).map_err(|e| bad(number, "RMC", e.to_string()))?;
        if rmc.status_of_fix == RmcStatusOfFix::Invalid {
            continue;
        }
        let (Some(date), Some(time), Some(lat), Some(lon)) =
            (rmc.fix_date, rmc.fix_time, rmc.lat, rmc.lon)
        else {
            continue;
        };
        let ns = date.and_time(time).and_utc().timestamp_nanos_opt();
        let ns = ns.ok_or_else(|| bad(number, "RMC", "its date is beyond 2262"))?;
        fixes.push((
            ns,
            Fix {
                time_s: 0.0,
                latitude_deg: lat,
                longitude_deg: lon,
                speed_mps: rmc
                    .speed_over_ground
                    .map(|knots| f64::from(knots) * KNOT_MPS),
            },
        ));
    }
    if known {
        Ok(fixes)
    } else {
        Err(bad(1, "NMEA", "no sentence in it ($GPRMC,…)"))
    }
}

#[cfg(test)]
#[path = "gps_log_tests.rs"]
mod tests;
