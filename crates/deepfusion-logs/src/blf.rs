//! CAN frames of Vector's binary log, BLF. The layout follows python-can's documentation and Vector's own header file of the
//! format; numbers are little-endian.
//!
//! A file's header (`LOGG`) gives the start of the measurement. Objects (`LOBJ`) follow. Most are containers: their contents,
//! decompressed and concatenated, are objects again, and one may begin in one container and end in the next. Objects other than
//! CAN frames are skipped.

use crate::error::{Error, Result};
use crate::problem::BlfProblem;
use deepfusion_motion::can::CanId;
use std::fs::File;
use std::io::{BufReader, Read};
use std::path::Path;

/// The first bytes of a file.
pub(crate) const MARK: [u8; 4] = *b"LOGG";
const OBJECT: [u8; 4] = *b"LOBJ";
/// Length of the part of an object's header that all versions share, and of the part with the time.
const BASE: usize = 16;
const TIMED: usize = 32;
/// Length of the part of the file's header that is read.
const HEADER: usize = 56;
/// Length of a container's own header, which follows the object's.
const CONTAINER: usize = 16;
/// Largest content of an object that is accepted; Vector's containers have 128 kB.
const MOST: usize = 1 << 28;

const CAN_MESSAGE: u32 = 1;
const LOG_CONTAINER: u32 = 10;
const CAN_MESSAGE2: u32 = 86;
const CAN_FD_MESSAGE: u32 = 100;
const CAN_FD_MESSAGE_64: u32 = 101;

/// Result of reading a part of a file.
type Parsed<T> = std::result::Result<T, BlfProblem>;

/// A CAN frame of a file.
pub(crate) struct BlfFrame<'a> {
    /// Since the measurement's start, in nanoseconds.
    pub(crate) ns: i64,
    pub(crate) channel: u16,
    pub(crate) id: CanId,
    pub(crate) data: &'a [u8],
}

/// Passes every CAN frame of a file that has data to `found`. Returns the start of the measurement: its recorder's date in nanoseconds
/// since 1970, whose time zone the format does not give; `None` if the file has none.
///
/// # Errors
/// [`Error::File`]; [`Error::Bytes`] for a file that was cut off or is damaged, with the place in the file.
pub(crate) fn read(path: &Path, mut found: impl FnMut(BlfFrame<'_>)) -> Result<Option<i64>> {
    let file = File::open(path).map_err(|e| Error::file(path, e))?;
    let length = file.metadata().map_err(|e| Error::file(path, e))?.len();
    let mut file = Objects {
        path,
        length,
        at: 0,
        input: BufReader::new(file),
    };
    let start_ns = file.header()?;
    // The unread rest of the containers' contents: the beginning of an object.
    let mut rest: Vec<u8> = Vec::new();
    while let Some((offset, object)) = file.next()? {
        if u32_at(&object, 12) != LOG_CONTAINER {
            frame(&object, &mut found).map_err(|why| file.bad(offset, "object", why))?;
            continue;
        }
        let begun = rest.len();
        inflate(&object, &mut rest).map_err(|why| file.bad(offset, "LOG_CONTAINER", why))?;
        let used = objects(&rest, &mut found).map_err(|(at, why)| {
            let within = BlfProblem::Within {
                at: at as i64 - begun as i64,
                problem: Box::new(why),
            };
            file.bad(offset, "LOG_CONTAINER", within)
        })?;
        rest.drain(..used);
    }
    if rest.iter().any(|byte| *byte != 0) {
        return Err(file.bad(length, "LOG_CONTAINER", BlfProblem::ObjectCut));
    }
    Ok(start_ns)
}

/// The objects of a file.
struct Objects<'a> {
    path: &'a Path,
    length: u64,
    at: u64,
    input: BufReader<File>,
}

impl Objects<'_> {
    fn bad(&self, offset: u64, field: &'static str, problem: BlfProblem) -> Error {
        Error::Bytes {
            path: self.path.to_owned(),
            offset,
            field,
            problem: problem.into(),
        }
    }

    /// The next `count` bytes.
    fn take(&mut self, field: &'static str, count: usize, into: &mut Vec<u8>) -> Result<()> {
        let left = self.length.saturating_sub(self.at);
        if (count as u64) > left {
            return Err(self.bad(self.at, field, BlfProblem::Cut { left, count }));
        }
        let before = into.len();
        into.resize(before + count, 0);
        self.input
            .read_exact(&mut into[before..])
            .map_err(|e| Error::file(self.path, e))?;
        self.at += count as u64;
        Ok(())
    }

    /// Reads the file's header: the start of the measurement.
    fn header(&mut self) -> Result<Option<i64>> {
        let mut header = Vec::new();
        self.take("LOGG", HEADER, &mut header)?;
        if header[..4] != MARK {
            return Err(self.bad(0, "LOGG", BlfProblem::NoLog));
        }
        let size = u32_at(&header, 4) as usize;
        if !(HEADER..=MOST).contains(&size) {
            return Err(self.bad(4, "LOGG", BlfProblem::Header(size)));
        }
        // A recorder that was switched off wrote only the size of the header.
        let (stated, bytes) = (u64_at(&header, 16), self.length);
        if stated > bytes {
            return Err(self.bad(bytes, "LOGG", BlfProblem::Length { stated, bytes }));
        }
        self.take("LOGG", size - HEADER, &mut header)?;
        let date: [u16; 8] = std::array::from_fn(|i| u16_at(&header, 40 + 2 * i));
        if date == [0; 8] {
            return Ok(None);
        }
        let ns = start_of(date)
            .ok_or_else(|| self.bad(40, "measurement start", BlfProblem::Date(date)))?;
        Ok(Some(ns))
    }

    /// The next object, and where it begins; `None` at the end.
    fn next(&mut self) -> Result<Option<(u64, Vec<u8>)>> {
        let mut object = Vec::new();
        // Up to three bytes, in some files seven, pad an object to a whole number of words.
        let mut begun = self.at;
        loop {
            let left = self.length - self.at;
            let missing = 4 - object.len();
            if left < missing as u64 {
                let mut end = Vec::new();
                self.take("LOBJ", left as usize, &mut end)?;
                if object.iter().chain(&end).any(|byte| *byte != 0) {
                    return Err(self.bad(begun, "LOBJ", BlfProblem::ObjectCut));
                }
                return Ok(None);
            }
            self.take("LOBJ", missing, &mut object)?;
            if object == OBJECT {
                break;
            }
            if object[0] != 0 {
                return Err(self.bad(self.at - 4, "LOBJ", BlfProblem::NoObject));
            }
            object.remove(0);
            begun += 1;
        }
        self.take("LOBJ", BASE - 4, &mut object)?;
        let size = u32_at(&object, 8) as usize;
        if !(BASE..=MOST).contains(&size) {
            return Err(self.bad(begun, "LOBJ", BlfProblem::Object(size)));
        }
        self.take("LOBJ", size - BASE, &mut object)?;
        Ok(Some((begun, object)))
    }
}

/// Adds the content of a container.
fn inflate(object: &[u8], into: &mut Vec<u8>) -> Parsed<()> {
    let (Some(head), Some(bytes)) = (
        object.get(BASE..BASE + CONTAINER),
        object.get(BASE + CONTAINER..),
    ) else {
        return Err(BlfProblem::Container(object.len()));
    };
    let (method, size) = (u16_at(head, 0), u32_at(head, 8) as usize);
    let before = into.len();
    match method {
        // Not every writer gives the size of uncompressed content.
        0 => {
            into.extend_from_slice(bytes);
            return Ok(());
        }
        2 if size > MOST => return Err(BlfProblem::TooLarge(size)),
        2 => {
            // Reads one byte more than expected, to notice longer content.
            let mut inflated = flate2::read::ZlibDecoder::new(bytes).take(size as u64 + 1);
            inflated.read_to_end(into).map_err(BlfProblem::Zlib)?;
        }
        other => return Err(BlfProblem::Compression(other)),
    }
    let bytes = into.len() - before;
    if bytes == size {
        Ok(())
    } else {
        let stated = size;
        Err(BlfProblem::ContainerSize { bytes, stated })
    }
}

/// Reads the complete objects of a stream and returns their length in bytes. An error has its position.
fn objects(
    bytes: &[u8],
    found: &mut impl FnMut(BlfFrame<'_>),
) -> std::result::Result<usize, (usize, BlfProblem)> {
    let mut at = 0;
    loop {
        let mut begin = at;
        while bytes.get(begin) == Some(&0) {
            begin += 1;
        }
        let Some(head) = bytes.get(begin..begin + BASE) else {
            // The rest is checked with the next container's bytes.
            return Ok(begin.min(bytes.len()));
        };
        if head[..4] != OBJECT {
            return Err((begin, BlfProblem::NoObject));
        }
        let size = u32_at(head, 8) as usize;
        if !(BASE..=MOST).contains(&size) {
            return Err((begin, BlfProblem::Object(size)));
        }
        let Some(object) = bytes.get(begin..begin + size) else {
            return Ok(begin);
        };
        frame(object, found).map_err(|why| (begin, why))?;
        at = begin + size;
    }
}

/// Passes on an object's CAN frame, if it is one.
fn frame(object: &[u8], found: &mut impl FnMut(BlfFrame<'_>)) -> Parsed<()> {
    let kind = u32_at(object, 12);
    if !matches!(
        kind,
        CAN_MESSAGE | CAN_MESSAGE2 | CAN_FD_MESSAGE | CAN_FD_MESSAGE_64
    ) {
        return Ok(());
    }
    let short = || BlfProblem::Frame(object.len());
    let header = usize::from(u16_at(object, 4));
    if header < TIMED || object.len() < header + 8 {
        return Err(short());
    }
    let unit_ns = match u32_at(object, 16) & 3 {
        1 => 10_000,
        2 => 1,
        other => return Err(BlfProblem::TimeUnit(other)),
    };
    let ticks = i64::try_from(u64_at(object, 24)).ok();
    let ns = ticks
        .and_then(|ticks| ticks.checked_mul(unit_ns))
        .ok_or(BlfProblem::TooLate)?;
    let body = &object[header..];
    let identifier = u32_at(body, 4);
    let channel = match kind {
        CAN_FD_MESSAGE_64 => u16::from(body[0]),
        _ => u16_at(body, 0),
    };
    let byte = |at: usize| body.get(at).copied().ok_or_else(short);
    let (first, length, remote) = match kind {
        CAN_FD_MESSAGE => (20, usize::from(byte(14)?), byte(2)? & 0x80 != 0),
        CAN_FD_MESSAGE_64 => (40, usize::from(byte(2)?), byte(12)? & 0x10 != 0),
        _ => (8, usize::from(byte(3)?).min(8), byte(2)? & 0x80 != 0),
    };
    // A remote request has no data.
    if remote {
        return Ok(());
    }
    // Vector's own files may give more bytes than there are: those are zeros, from which no signal is read.
    let Some(data) = body.get(first..body.len().min(first + length)) else {
        return Err(short());
    };
    let id = if identifier & 0x8000_0000 != 0 {
        CanId::Extended {
            extended: identifier & 0x1fff_ffff,
        }
    } else if identifier < 0x800 {
        CanId::Standard(identifier as u16)
    } else {
        return Err(BlfProblem::LongIdentifier(identifier));
    };
    found(BlfFrame {
        ns,
        channel,
        id,
        data,
    });
    Ok(())
}

/// Windows' SYSTEMTIME in nanoseconds since 1970, as if it were UTC.
fn start_of(date: [u16; 8]) -> Option<i64> {
    let [year, month, _, day, hour, minute, second, millisecond] =
        date.map(|part| i16::try_from(part).unwrap_or(-1));
    let small = |part: i16| i8::try_from(part).ok();
    let date = jiff::civil::DateTime::new(
        year,
        small(month)?,
        small(day)?,
        small(hour)?,
        small(minute)?,
        small(second)?,
        i32::from(millisecond) * 1_000_000,
    );
    let stamp = date.ok()?.to_zoned(jiff::tz::TimeZone::UTC).ok()?;
    i64::try_from(stamp.timestamp().as_nanosecond()).ok()
}

/// Two bytes at `at`; the caller checked the length.
fn u16_at(bytes: &[u8], at: usize) -> u16 {
    u16::from_le_bytes([bytes[at], bytes[at + 1]])
}

fn u32_at(bytes: &[u8], at: usize) -> u32 {
    u32::from(u16_at(bytes, at)) | u32::from(u16_at(bytes, at + 2)) << 16
}

fn u64_at(bytes: &[u8], at: usize) -> u64 {
    u64::from(u32_at(bytes, at)) | u64::from(u32_at(bytes, at + 4)) << 32
}
