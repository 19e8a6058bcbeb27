//! Records, the building blocks of the file: a number for the kind, the length, the content.
//!
//! All numbers are little-endian; a string is its length (u32) and its bytes.

use deepfusion_hint::count_of;

/// The file's first and last bytes.
pub(super) const MAGIC: &[u8] = b"\x89MCAP0\r\n";
/// Length of a record's header: its kind and length.
const HEAD: usize = 9;
/// Length of the footer and the magic after it.
pub(super) const TAIL: usize = HEAD + 20 + MAGIC.len();

pub(super) mod op {
    pub(crate) const FOOTER: u8 = 0x02;
    pub(crate) const SCHEMA: u8 = 0x03;
    pub(crate) const CHANNEL: u8 = 0x04;
    pub(crate) const MESSAGE: u8 = 0x05;
    pub(crate) const CHUNK: u8 = 0x06;
    pub(crate) const MESSAGE_INDEX: u8 = 0x07;
    pub(crate) const CHUNK_INDEX: u8 = 0x08;
    pub(crate) const STATISTICS: u8 = 0x0b;
    pub(crate) const DATA_END: u8 = 0x0f;
}

/// A record in its file or chunk.
#[derive(Debug, Clone, Copy)]
pub(super) struct Record<'a> {
    pub op: u8,
    /// Position of its content.
    pub start: usize,
    pub content: &'a [u8],
}

impl Record<'_> {
    /// Position of the next record.
    pub(super) fn end(&self) -> usize {
        self.start + self.content.len()
    }
}

/// An incomplete record.
#[derive(Debug, PartialEq)]
pub(super) struct TruncatedRecord<'a> {
    pub op: Option<u8>,
    /// Position of the record.
    pub at: usize,
    /// Start of its content, and the part of it that exists.
    pub start: usize,
    pub content: &'a [u8],
    pub missing: u64,
}

/// What is wrong with a record of an MCAP file. Positions are in the file, or in the chunk that contains the record.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum RecordProblem {
    /// The end of the record is missing.
    #[error("the record at byte {at} (type {op:#04x}) lacks {}", count_of(*missing, "byte"))]
    Cut {
        /// Position of the record.
        at: usize,
        /// Kind of the record.
        op: u8,
        /// Number of missing bytes.
        missing: u64,
    },
    /// The record ends within its kind and length.
    #[error("the record at byte {at} is cut off within its header")]
    HeadCut {
        /// Position of the record.
        at: usize,
    },
    /// A message is shorter than its header.
    #[error("the message at byte {at} is too short")]
    ShortMessage {
        /// Position of the record.
        at: usize,
    },
}

impl TruncatedRecord<'_> {
    pub(super) fn problem(&self) -> RecordProblem {
        let (at, missing) = (self.at, self.missing);
        match self.op {
            Some(op) => RecordProblem::Cut { at, op, missing },
            None => RecordProblem::HeadCut { at },
        }
    }
}

/// The record at `at`; `None` at the end.
pub(super) fn record(bytes: &[u8], at: usize) -> Result<Option<Record<'_>>, TruncatedRecord<'_>> {
    let rest = bytes.get(at..).unwrap_or_default();
    if rest.is_empty() {
        return Ok(None);
    }
    let head = rest.first_chunk::<HEAD>();
    let Some([op, length @ ..]) = head else {
        return Err(TruncatedRecord {
            op: None,
            at,
            start: bytes.len(),
            content: &[],
            missing: 0,
        });
    };
    let (length, content) = (u64::from_le_bytes(*length), &rest[HEAD..]);
    let start = at + HEAD;
    let whole = usize::try_from(length).ok().and_then(|n| content.get(..n));
    match whole {
        Some(content) => Ok(Some(Record {
            op: *op,
            start,
            content,
        })),
        None => Err(TruncatedRecord {
            op: Some(*op),
            at,
            start,
            content,
            missing: length - content.len() as u64,
        }),
    }
}

/// The part of a record's content that has not been read yet. Its functions return `None` if it ends too early.
pub(super) struct Fields<'a>(pub &'a [u8]);

impl<'a> Fields<'a> {
    pub(super) fn bytes(&mut self, count: usize) -> Option<&'a [u8]> {
        let (taken, rest) = self.0.split_at_checked(count)?;
        self.0 = rest;
        Some(taken)
    }

    fn array<const N: usize>(&mut self) -> Option<[u8; N]> {
        let (taken, rest) = self.0.split_first_chunk()?;
        self.0 = rest;
        Some(*taken)
    }

    pub(super) fn u16(&mut self) -> Option<u16> {
        self.array().map(u16::from_le_bytes)
    }

    pub(super) fn u32(&mut self) -> Option<u32> {
        self.array().map(u32::from_le_bytes)
    }

    pub(super) fn u64(&mut self) -> Option<u64> {
        self.array().map(u64::from_le_bytes)
    }

    pub(super) fn text(&mut self) -> Option<String> {
        let length = self.u32()? as usize;
        let bytes = self.bytes(length)?;
        Some(String::from_utf8_lossy(bytes).into_owned())
    }

    /// A map of numbers, preceded by its length in bytes.
    pub(super) fn map(&mut self) -> Option<Vec<(u16, u64)>> {
        let length = self.u32()? as usize;
        let mut inside = Fields(self.bytes(length)?);
        let mut entries = Vec::new();
        while !inside.0.is_empty() {
            entries.push((inside.u16()?, inside.u64()?));
        }
        Some(entries)
    }
}

/// A message's channel and time of recording, which precede its bytes.
pub(super) struct MessageHead {
    pub channel: u16,
    pub log_time: u64,
}

/// Number of bytes before a message's own.
pub(super) const MESSAGE_HEAD: usize = 2 + 4 + 8 + 8;

impl MessageHead {
    pub(super) fn read(content: &[u8]) -> Option<Self> {
        let mut fields = Fields(content);
        let (channel, _sequence) = (fields.u16()?, fields.u32()?);
        let (log_time, _publish_time) = (fields.u64()?, fields.u64()?);
        Some(Self { channel, log_time })
    }
}

/// A chunk's header, and the position of its content in the file.
#[derive(Debug, Clone)]
pub(super) struct ChunkHead {
    pub size: u64,
    pub crc: u32,
    pub compression: String,
    /// Number of bytes as stored.
    pub stored: u64,
    /// Length of this header, bytes.
    pub length: usize,
}

impl ChunkHead {
    pub(super) fn read(content: &[u8]) -> Option<Self> {
        let mut fields = Fields(content);
        let (_first, _last, size) = (fields.u64()?, fields.u64()?, fields.u64()?);
        let (crc, compression) = (fields.u32()?, fields.text()?);
        let stored = fields.u64()?;
        Some(Self {
            size,
            crc,
            compression,
            stored,
            length: content.len() - fields.0.len(),
        })
    }
}
