//! A minimal MP4 reader for tracks of metadata: the positions and times of a track's samples.

use crate::error::Error;
use crate::problem::{BytesProblem, Mp4Problem};
use std::ops::Range;
use std::path::Path;

/// A sample of a track.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(crate) struct Sample {
    /// Range of its bytes in the file.
    pub(crate) bytes: Range<usize>,
    /// Its beginning and end, in nanoseconds from the track's beginning.
    pub(crate) ns: Range<i64>,
}

/// What is wrong, and at which byte.
pub(crate) struct Broken {
    pub(crate) offset: usize,
    pub(crate) field: &'static str,
    pub(crate) problem: BytesProblem,
}

impl Broken {
    /// Converts it to an error about a file.
    pub(crate) fn of(self, path: &Path) -> Error {
        Error::Bytes {
            path: path.to_owned(),
            offset: self.offset as u64,
            field: self.field,
            problem: self.problem,
        }
    }
}

/// A box, with its content as a range of the file.
struct BoxContent<'a> {
    file: &'a [u8],
    range: Range<usize>,
}

/// A movie's user data of one kind; `None` if the file is not a movie or has no such data.
pub(crate) fn udta(file: &[u8], kind: &[u8; 4]) -> Result<Option<Range<usize>>, Broken> {
    let whole = BoxContent {
        file,
        range: 0..file.len(),
    };
    let found = whole.path(&[b"moov", b"udta", kind])?;
    Ok(found.map(|found| found.range))
}

/// The samples of the first track whose format is `format`; `None` where there is no such track.
pub(crate) fn samples(file: &[u8], format: &[u8; 4]) -> Result<Option<Vec<Sample>>, Broken> {
    let whole = BoxContent {
        file,
        range: 0..file.len(),
    };
    let Some(movie) = whole.first(b"moov")? else {
        return Err(Broken {
            offset: file.len(),
            field: "moov",
            problem: Mp4Problem::NoMovie.into(),
        });
    };
    for track in movie.all(b"trak")? {
        let Some(media) = track.first(b"mdia")? else {
            continue;
        };
        let Some(table) = media.path(&[b"minf", b"stbl"])? else {
            continue;
        };
        let Some(description) = table.first(b"stsd")? else {
            continue;
        };
        // Version and flags, number of entries, size of the first, its format.
        if description.bytes(12, 4)? != format {
            continue;
        }
        let scale = match media.first(b"mdhd")? {
            Some(header) => header.timescale()?,
            None => return Err(track.broken("mdhd", Mp4Problem::NoBox)),
        };
        return table.samples(scale).map(Some);
    }
    Ok(None)
}

impl BoxContent<'_> {
    fn broken(&self, field: &'static str, problem: Mp4Problem) -> Broken {
        Broken {
            offset: self.range.start,
            field,
            problem: problem.into(),
        }
    }

    /// `length` bytes from `at`, counted from the box's contents.
    fn bytes(&self, at: usize, length: usize) -> Result<&[u8], Broken> {
        let start = self.range.start.checked_add(at);
        let bytes = start
            .and_then(|s| s.checked_add(length).map(|e| s..e))
            .filter(|r| r.end <= self.range.end);
        bytes
            .and_then(|r| self.file.get(r))
            .ok_or_else(|| self.broken("box", Mp4Problem::Cut))
    }

    fn u32(&self, at: usize) -> Result<u32, Broken> {
        let bytes = self.bytes(at, 4)?;
        Ok(bytes.iter().fold(0, |n, b| n << 8 | u32::from(*b)))
    }

    fn u64(&self, at: usize) -> Result<u64, Broken> {
        Ok(u64::from(self.u32(at)?) << 32 | u64::from(self.u32(at + 4)?))
    }

    /// The boxes of one kind in this one.
    fn all(&self, kind: &[u8; 4]) -> Result<Vec<BoxContent<'_>>, Broken> {
        let (mut found, mut at) = (Vec::new(), 0);
        let length = self.range.len();
        while at + 8 <= length {
            let (mut size, mut header) = (self.u32(at)? as u64, 8);
            if size == 1 {
                (size, header) = (self.u64(at + 8)?, 16);
            } else if size == 0 {
                size = (length - at) as u64;
            }
            let end = usize::try_from(size).ok().and_then(|s| at.checked_add(s));
            let Some(end) = end.filter(|end| *end <= length && size >= header as u64) else {
                let offset = self.range.start + at;
                let name = String::from_utf8_lossy(self.bytes(at + 4, 4)?).into_owned();
                let left = length - at;
                return Err(Broken {
                    offset,
                    field: "box",
                    problem: Mp4Problem::Size { name, size, left }.into(),
                });
            };
            if self.bytes(at + 4, 4)? == kind {
                let range = self.range.start + at + header..self.range.start + end;
                found.push(BoxContent {
                    file: self.file,
                    range,
                });
            }
            at = end;
        }
        Ok(found)
    }

    fn first(&self, kind: &[u8; 4]) -> Result<Option<BoxContent<'_>>, Broken> {
        let all = self.all(kind)?;
        Ok(all.into_iter().next().map(|found| BoxContent {
            file: self.file,
            range: found.range,
        }))
    }

    fn path(&self, kinds: &[&[u8; 4]]) -> Result<Option<BoxContent<'_>>, Broken> {
        let mut at = BoxContent {
            file: self.file,
            range: self.range.clone(),
        };
        for kind in kinds {
            let next = at.first(kind)?.map(|found| found.range);
            let Some(range) = next else { return Ok(None) };
            at = BoxContent {
                file: self.file,
                range,
            };
        }
        Ok(Some(at))
    }

    /// Ticks per second of a media header.
    fn timescale(&self) -> Result<u32, Broken> {
        let at = if self.bytes(0, 1)?[0] == 1 { 20 } else { 12 };
        match self.u32(at)? {
            0 => Err(self.broken("mdhd", Mp4Problem::Timescale)),
            scale => Ok(scale),
        }
    }

    /// The samples of a sample table: their sizes, the chunks they lie in, their durations.
    fn samples(&self, scale: u32) -> Result<Vec<Sample>, Broken> {
        let needed = |kind: &'static [u8; 4], name| {
            self.first(kind)?
                .ok_or_else(|| self.broken(name, Mp4Problem::NoBox))
        };
        let (sizes, durations, runs) = (
            needed(b"stsz", "stsz")?,
            needed(b"stts", "stts")?,
            needed(b"stsc", "stsc")?,
        );
        let count = sizes.u32(8)? as usize;
        let one_size = sizes.u32(4)?;
        // Each sample takes at least one byte of the file, so a count cannot demand more memory than the file's size.
        if count > self.file.len() {
            return Err(sizes.broken("stsz", Mp4Problem::Samples));
        }
        let size = |i: usize| match one_size {
            0 => sizes.u32(12 + 4 * i),
            size => Ok(size),
        };
        let (offsets, wide) = match self.first(b"stco")? {
            Some(offsets) => (offsets, false),
            None => (needed(b"co64", "stco")?, true),
        };
        let offset = |chunk: usize| {
            if wide {
                offsets.u64(8 + 8 * chunk)
            } else {
                offsets.u32(8 + 4 * chunk).map(u64::from)
            }
        };
        let chunks = offsets.u32(4)? as usize;
        let mut begins = durations.starts(scale)?;
        // The existing entries are read before memory is reserved for the rest.
        let (mut samples, mut run) = (Vec::new(), 0);
        let runs_count = runs.u32(4)? as usize;
        for chunk in 0..chunks {
            // A run gives the first chunk (counted from 1) from which on each chunk has this many samples.
            while run + 1 < runs_count && runs.u32(8 + 12 * (run + 1))? as usize <= chunk + 1 {
                run += 1;
            }
            let mut at = offset(chunk)?;
            for _ in 0..runs.u32(8 + 12 * run + 4)? {
                let index = samples.len();
                if index == count {
                    break;
                }
                let end = at.saturating_add(u64::from(size(index)?));
                let bytes = usize::try_from(at).ok().zip(usize::try_from(end).ok());
                let Some((from, to)) = bytes.filter(|(_, to)| *to <= self.file.len()) else {
                    return Err(self.broken("stco", Mp4Problem::Beyond));
                };
                let ns = begins
                    .next()
                    .ok_or_else(|| durations.broken("stts", Mp4Problem::Times))?;
                samples.push(Sample {
                    bytes: from..to,
                    ns,
                });
                at = end;
            }
        }
        Ok(samples)
    }

    /// Beginning and end of each sample.
    fn starts(&self, scale: u32) -> Result<impl Iterator<Item = Range<i64>>, Broken> {
        let mut entries = Vec::new();
        for entry in 0..self.u32(4)? as usize {
            entries.push((self.u32(8 + 8 * entry)?, self.u32(12 + 8 * entry)?));
        }
        let ns = move |ticks: u64| (ticks as f64 / f64::from(scale) * 1e9).round() as i64;
        let mut ticks = 0_u64;
        let each = entries
            .into_iter()
            .flat_map(|(repeats, ticks_each)| (0..repeats).map(move |_| ticks_each));
        Ok(each.map(move |ticks_each| {
            let begin = ticks;
            ticks = begin.saturating_add(u64::from(ticks_each));
            ns(begin)..ns(ticks)
        }))
    }
}
