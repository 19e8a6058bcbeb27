//! Sentences of receivers (NMEA 0183).

use crate::error::{BadLine, Result};
use crate::log::{DriveLog, Format};
use crate::problem::NmeaProblem;
use crate::track::{TimedFix, log_of_fixes};
use deepfusion_motion::Fix;
use nmea::sentences::rmc::{RmcStatusOfFix, parse_rmc};
use std::path::Path;

/// One knot in m/s.
const KNOT_MPS: f64 = 1852.0 / 3600.0;

/// Reads a receiver's log.
pub(crate) fn read(path: &Path) -> Result<DriveLog> {
    let bytes = std::fs::read(path).map_err(|e| crate::Error::file(path, e))?;
    let fixes = sentences(&bytes).map_err(|bad| bad.of(path))?;
    log_of_fixes(path, Format::Nmea, &fixes)
}

/// The fixes of RMC sentences, whose checksums are verified. Other sentences, and anything between sentences, are skipped.
fn sentences(bytes: &[u8]) -> std::result::Result<Vec<TimedFix>, BadLine> {
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
        let bad = |problem: NmeaProblem| BadLine::new(number, "RMC", problem);
        let refused = |e: nmea::Error<'_>| bad(NmeaProblem::Sentence(e.to_string()));
        let sentence = nmea::parse_nmea_sentence(text).map_err(refused)?;
        let (found, stated) = (sentence.calc_checksum(), sentence.checksum);
        if found != stated {
            return Err(bad(NmeaProblem::Checksum { found, stated }));
        }
        let rmc = parse_rmc(sentence).map_err(refused)?;
        if rmc.status_of_fix == RmcStatusOfFix::Invalid {
            continue;
        }
        let (Some(date), Some(time), Some(lat), Some(lon)) =
            (rmc.fix_date, rmc.fix_time, rmc.lat, rmc.lon)
        else {
            continue;
        };
        let ns = date.and_time(time).and_utc().timestamp_nanos_opt();
        let ns = ns.ok_or_else(|| bad(NmeaProblem::TooLate))?;
        fixes.push(TimedFix {
            ns,
            fix: Fix {
                time_s: 0.0,
                latitude_deg: lat,
                longitude_deg: lon,
                speed_mps: rmc
                    .speed_over_ground
                    .map(|knots| f64::from(knots) * KNOT_MPS),
            },
        });
    }
    if known {
        Ok(fixes)
    } else {
        Err(BadLine::new(1, "NMEA", NmeaProblem::NoSentence))
    }
}
