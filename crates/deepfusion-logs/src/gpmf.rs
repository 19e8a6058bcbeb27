//! GoPro's metadata: a separate track of the video with keys, lengths and values. Its times need no clock: each payload belongs to about a
//! second of the video, over which its readings are spread evenly.

use crate::error::{Error, NoGps, Result};
use crate::log::{Clock, DriveLog, Format, Speed};
use crate::mp4::{Broken, Sample, samples};
use crate::note::{GoproNote, LogNote, TurnsNote};
use crate::problem::{GpmfProblem, SpeedProblem};
use crate::turns::{Heading, Sensor, yaw_rates};
use nalgebra::Vector3;
use std::path::Path;

/// One key with its data.
pub(crate) struct Entry<'a> {
    pub(crate) key: [u8; 4],
    kind: u8,
    /// Size of one reading, in bytes.
    size: usize,
    pub(crate) value: &'a [u8],
    /// Position in the file.
    pub(crate) offset: usize,
}

/// The readings of all payloads.
#[derive(Default)]
struct Readings {
    speeds: Vec<Speed>,
    places: Vec<(i64, f64, f64)>,
    rates: Vec<Sensor>,
    gravity: Vec<Sensor>,
    accelerations: Vec<Sensor>,
    without_fix: usize,
}

/// Reads the speeds of the camera's GPS receiver and the turns of its gyroscope.
pub(crate) fn read(path: &Path) -> Result<DriveLog> {
    let file = std::fs::File::open(path).map_err(|e| Error::file(path, e))?;
    // SAFETY: the file is only read. If it is truncated meanwhile, the system ends the process, as with every mapped file.
    let bytes = unsafe { memmap2::Mmap::map(&file) }.map_err(|e| Error::file(path, e))?;
    let broken = |broken: Broken| broken.of(path);
    let Some(payloads) = samples(&bytes, b"gpmd").map_err(broken)? else {
        return Err(Error::NoSpeed {
            path: path.to_owned(),
            problem: SpeedProblem::NoTrack,
        });
    };
    let mut found = Readings::default();
    for payload in &payloads {
        found.payload(&bytes, payload).map_err(broken)?;
    }
    if found.speeds.len() < 2 {
        return Err(Error::NoGps {
            path: path.to_owned(),
            why: match found.without_fix {
                0 => NoGps::SwitchedOff,
                _ => NoGps::NoFix,
            },
        });
    }
    let mut notes = vec![LogNote::from(GoproNote::Gps {
        readings: found.speeds.len(),
    })];
    if found.without_fix > 0 {
        let no_fix = GoproNote::NoFix {
            without: found.without_fix,
            stretches: payloads.len(),
        };
        notes.push(no_fix.into());
    }
    let up = if found.accelerations.is_empty() {
        &found.gravity
    } else {
        &found.accelerations
    };
    let yaw_rates = if found.rates.is_empty() || up.is_empty() {
        notes.push(TurnsNote::NoGyroscope.into());
        Vec::new()
    } else {
        let (turns, note) = yaw_rates(&found.rates, up, &courses(&found.places, &found.speeds));
        notes.push(note.into());
        turns
    };
    Ok(DriveLog {
        format: Format::Gpmf,
        clock: Clock::Video,
        speeds: found.speeds,
        yaw_rates,
        course_rates: Vec::new(),
        notes,
    })
}

impl Readings {
    fn payload(&mut self, file: &[u8], sample: &Sample) -> std::result::Result<(), Broken> {
        let base = sample.bytes.start;
        let bytes = file.get(sample.bytes.clone()).unwrap_or(&[]);
        for device in entries(bytes, base)?.iter().filter(|e| &e.key == b"DEVC") {
            for stream in entries(device.value, device.offset)?
                .iter()
                .filter(|e| &e.key == b"STRM")
            {
                self.stream(&entries(stream.value, stream.offset)?, sample)?;
            }
        }
        Ok(())
    }

    fn stream(&mut self, entries: &[Entry], sample: &Sample) -> std::result::Result<(), Broken> {
        let find = |key: &[u8; 4]| entries.iter().find(|e| &e.key == key);
        let scales = find(b"SCAL")
            .map(|e| e.numbers())
            .transpose()?
            .unwrap_or_default();
        let scale = |axis: usize| {
            scales
                .get(axis)
                .or(scales.first())
                .copied()
                .filter(|s| *s != 0.0)
                .unwrap_or(1.0)
        };
        let rows = |entry: &Entry, width: usize| entry.rows(find(b"TYPE").map(|e| e.value), width);
        let at = |index: usize, count: usize| {
            let length = (sample.ns.end - sample.ns.start) as f64;
            sample.ns.start + (length * index as f64 / count as f64).round() as i64
        };
        if let Some(entry) = find(b"GPS5") {
            // Latitude, longitude, altitude, speed over ground, speed in space. GPSF: 0 no fix, 2, 3 dimensions.
            let fixed = match find(b"GPSF") {
                Some(fix) => fix.numbers()?.first().is_some_and(|f| *f >= 2.0),
                None => true,
            };
            let rows = rows(entry, 5)?;
            if !fixed || rows.is_empty() {
                self.without_fix += 1;
            }
            for (i, row) in rows.iter().enumerate().filter(|_| fixed) {
                self.fix(
                    at(i, rows.len()),
                    row[0] / scale(0),
                    row[1] / scale(1),
                    row[3] / scale(3),
                );
            }
        } else if let Some(entry) = find(b"GPS9") {
            // The same five, days since 2000, seconds of the day, dilution of precision, fix.
            let rows = rows(entry, 9)?;
            if rows.iter().all(|row| row[8] / scale(8) < 2.0) {
                self.without_fix += 1;
            }
            for (i, row) in rows
                .iter()
                .enumerate()
                .filter(|(_, row)| row[8] / scale(8) >= 2.0)
            {
                self.fix(
                    at(i, rows.len()),
                    row[0] / scale(0),
                    row[1] / scale(1),
                    row[3] / scale(3),
                );
            }
        }
        for (key, into) in [(b"GYRO", 0), (b"GRAV", 1), (b"ACCL", 2)] {
            let Some(entry) = find(key) else { continue };
            // Which axes of the camera the three are differs between models (ORIN). If one chip holds gyroscope and accelerometer, both
            // have the same order. GRAV has an order of its own, and is used if ACCL is absent.
            let rows = rows(entry, 3)?;
            let readings = rows.iter().enumerate().map(|(i, row)| Sensor {
                ns: at(i, rows.len()),
                value: Vector3::new(row[0] / scale(0), row[1] / scale(1), row[2] / scale(2)),
            });
            match into {
                0 => self.rates.extend(readings),
                1 => self.gravity.extend(readings),
                _ => self.accelerations.extend(readings),
            }
        }
        Ok(())
    }

    fn fix(&mut self, ns: i64, latitude: f64, longitude: f64, mps: f64) {
        if self.speeds.last().is_some_and(|last| ns <= last.ns) || !mps.is_finite() {
            return;
        }
        self.speeds.push(Speed {
            ns,
            mps,
            sigma_mps: None,
        });
        self.places.push((ns, latitude, longitude));
    }
}

/// The course between positions a second apart, while the vehicle moved.
fn courses(places: &[(i64, f64, f64)], speeds: &[Speed]) -> Vec<Heading> {
    let (mut all, mut from) = (Vec::new(), 0);
    for (i, (ns, latitude, longitude)) in places.iter().enumerate() {
        let (before, latitude0, longitude0) = places[from];
        if ns - before < 1_000_000_000 {
            continue;
        }
        from = i;
        if speeds[i].mps > 3.0 {
            let north = latitude - latitude0;
            let east = (longitude - longitude0) * latitude.to_radians().cos();
            let middle = before + (ns - before) / 2;
            all.push(Heading {
                ns: middle,
                clockwise_rad: east.atan2(north),
            });
        }
    }
    all
}

/// The entries of a range of keys, lengths and values; each is padded to four bytes.
pub(crate) fn entries(bytes: &[u8], base: usize) -> std::result::Result<Vec<Entry<'_>>, Broken> {
    let (mut all, mut at) = (Vec::new(), 0);
    while at + 8 <= bytes.len() {
        let key = [bytes[at], bytes[at + 1], bytes[at + 2], bytes[at + 3]];
        // Padding at the end of a payload.
        if key == [0; 4] {
            break;
        }
        let size = usize::from(bytes[at + 5]);
        let length = size * usize::from(u16::from_be_bytes([bytes[at + 6], bytes[at + 7]]));
        let Some(value) = bytes.get(at + 8..at + 8 + length) else {
            let problem = GpmfProblem::Length {
                key: String::from_utf8_lossy(&key).into_owned(),
                length,
                left: bytes.len() - at - 8,
            };
            return Err(Broken {
                offset: base + at,
                field: "GPMF",
                problem: problem.into(),
            });
        };
        all.push(Entry {
            key,
            kind: bytes[at + 4],
            size,
            value,
            offset: base + at + 8,
        });
        at += 8 + length.next_multiple_of(4);
    }
    Ok(all)
}

/// Size in bytes of a number of a type, and its value.
fn number(kind: u8, bytes: &[u8]) -> Option<f64> {
    fn take<const N: usize>(bytes: &[u8]) -> Option<[u8; N]> {
        bytes.get(..N)?.try_into().ok()
    }
    Some(match kind {
        b'b' => f64::from(*bytes.first()? as i8),
        b'B' => f64::from(*bytes.first()?),
        b's' => f64::from(i16::from_be_bytes(take(bytes)?)),
        b'S' => f64::from(u16::from_be_bytes(take(bytes)?)),
        b'l' => f64::from(i32::from_be_bytes(take(bytes)?)),
        b'L' => f64::from(u32::from_be_bytes(take(bytes)?)),
        b'f' => f64::from(f32::from_be_bytes(take(bytes)?)),
        b'd' => f64::from_be_bytes(take(bytes)?),
        b'j' => i64::from_be_bytes(take(bytes)?) as f64,
        b'J' => u64::from_be_bytes(take(bytes)?) as f64,
        _ => return None,
    })
}

fn width(kind: u8) -> Option<usize> {
    match kind {
        b'b' | b'B' => Some(1),
        b's' | b'S' => Some(2),
        b'l' | b'L' | b'f' => Some(4),
        b'd' | b'j' | b'J' => Some(8),
        _ => None,
    }
}

impl Entry<'_> {
    fn broken(&self, problem: impl FnOnce(String) -> GpmfProblem) -> Broken {
        let key = String::from_utf8_lossy(&self.key).into_owned();
        Broken {
            offset: self.offset,
            field: "GPMF",
            problem: problem(key).into(),
        }
    }

    /// Whether its value consists of further entries.
    pub(crate) fn is_nest(&self) -> bool {
        self.kind == 0
    }

    /// Its value as text, without padding; `None` for numbers.
    pub(crate) fn text(&self) -> Option<String> {
        let text = String::from_utf8_lossy(self.value);
        let text = text.trim_matches(|c: char| c == '\0' || c.is_whitespace());
        matches!(self.kind, b'c' | b'F').then(|| text.to_owned())
    }

    /// All numbers of an entry with a single type.
    pub(crate) fn numbers(&self) -> std::result::Result<Vec<f64>, Broken> {
        let Some(width) = width(self.kind) else {
            let kind = char::from(self.kind);
            return Err(self.broken(|key| GpmfProblem::NoNumbers { key, kind }));
        };
        Ok(self
            .value
            .chunks_exact(width)
            .filter_map(|bytes| number(self.kind, bytes))
            .collect())
    }

    /// The readings, of at least `least` numbers each; `complex` is the list of types of an entry of type '?'.
    fn rows(
        &self,
        complex: Option<&[u8]>,
        least: usize,
    ) -> std::result::Result<Vec<Vec<f64>>, Broken> {
        let kinds: Vec<u8> = match (self.kind, complex) {
            (b'?', Some(kinds)) => kinds.iter().copied().filter(|k| *k != 0).collect(),
            (b'?', None) => return Err(self.broken(|key| GpmfProblem::NoType { key })),
            (kind, _) => match width(kind) {
                Some(width) => vec![kind; self.size / width],
                None => Vec::new(),
            },
        };
        let widths: Option<Vec<usize>> = kinds.iter().map(|k| width(*k)).collect();
        let Some(widths) =
            widths.filter(|w| w.len() >= least && w.iter().sum::<usize>() == self.size)
        else {
            let bytes = self.size;
            return Err(self.broken(|key| GpmfProblem::Readings { key, bytes, least }));
        };
        let row = |bytes: &[u8]| {
            let mut at = 0;
            let numbers = kinds.iter().zip(&widths).map(|(kind, width)| {
                at += width;
                number(*kind, &bytes[at - width..at])
            });
            numbers.collect::<Option<Vec<f64>>>()
        };
        Ok(self.value.chunks_exact(self.size).filter_map(row).collect())
    }
}
