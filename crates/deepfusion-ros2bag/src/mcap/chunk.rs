//! A decompressed chunk, and the positions of its messages.

use super::record::{ChunkHead, Fields, MESSAGE_HEAD, MessageHead, RecordProblem, op, record};
use crate::storage::MOST_BYTES;
use deepfusion_hint::count_of;
use deepfusion_rosbag::Time;
use std::io::{self, Read};
use std::ops::Range;
use std::sync::Arc;

/// Why a chunk of an MCAP file, or a part of it, cannot be read.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum ChunkProblem {
    /// The chunk ends within its header.
    #[error("its header is cut off")]
    HeadCut,
    /// The end of the chunk is missing.
    #[error(
        "{missing} of its {} {} missing",
        count_of(*stored, "byte"),
        if *missing == 1 { "is" } else { "are" }
    )]
    Cut {
        /// Number of missing bytes.
        missing: u64,
        /// Number of bytes there should be.
        stored: u64,
    },
    /// The chunk is larger than allowed.
    #[error("{} decompressed, the limit is {MOST_BYTES}", count_of(*size, "byte"))]
    TooLarge {
        /// Its decompressed size, bytes.
        size: u64,
    },
    /// The compression is unknown.
    #[error("unknown compression `{name}`, expected none, lz4 or zstd")]
    Compression {
        /// Name of the compression.
        name: String,
    },
    /// The decoder cannot be set up.
    #[error("{0}")]
    Decoder(#[source] io::Error),
    /// The chunk cannot be decompressed.
    #[error("cannot be decompressed: {0}")]
    Unpack(#[source] io::Error),
    /// The chunk has another length than its header says.
    #[error("{} decompressed, its header says {stated}", count_of(*bytes, "byte"))]
    Length {
        /// Number of decompressed bytes.
        bytes: u64,
        /// The length in its header, bytes.
        stated: u64,
    },
    /// The checksum differs from the header's.
    #[error("its checksum is wrong")]
    Checksum,
    /// A record in the chunk is incomplete.
    #[error("after decompression, {0}")]
    Record(#[source] RecordProblem),
    /// The chunk has a message before its first one.
    #[error("a message at {time}, the index says the first is at {first}")]
    Early {
        /// Time of the message.
        time: Time,
        /// Time of the first message according to the index.
        first: Time,
    },
}

/// A chunk's records: in the file itself, or decompressed.
#[derive(Debug, Clone)]
pub(super) enum Content<'a> {
    Stored(&'a [u8]),
    Unpacked(Arc<Vec<u8>>),
}

impl Content<'_> {
    pub(super) fn bytes(&self) -> &[u8] {
        match self {
            Self::Stored(bytes) => bytes,
            Self::Unpacked(bytes) => bytes,
        }
    }
}

/// A message of a chunk.
#[derive(Debug, Clone)]
pub(super) struct Entry {
    pub time: Time,
    pub channel: u16,
    /// The message's bytes, without its header.
    pub range: Range<usize>,
}

/// Decompresses the chunk whose record's content is `content`; on an error it returns what was read before, and the reason.
pub(super) fn open(content: &[u8]) -> (Content<'_>, Option<ChunkProblem>) {
    let Some(head) = ChunkHead::read(content) else {
        return (Content::Stored(&[]), Some(ChunkProblem::HeadCut));
    };
    let stored = &content[head.length..];
    let whole = usize::try_from(head.stored)
        .ok()
        .and_then(|n| stored.get(..n));
    let cut = whole.is_none().then(|| {
        let missing = head.stored - stored.len() as u64;
        let stored = head.stored;
        ChunkProblem::Cut { missing, stored }
    });
    let stored = whole.unwrap_or(stored);
    if head.size > MOST_BYTES {
        let size = head.size;
        return (Content::Stored(&[]), Some(ChunkProblem::TooLarge { size }));
    }
    let unpacked = match head.compression.as_str() {
        "" | "none" => Ok(Content::Stored(stored)),
        "lz4" => unpack(lz4_flex::frame::FrameDecoder::new(stored), head.size),
        "zstd" => match zstd::stream::read::Decoder::with_buffer(stored) {
            Ok(decoder) => unpack(decoder, head.size),
            Err(e) => Err((Vec::new(), ChunkProblem::Decoder(e))),
        },
        other => {
            let name = other.to_owned();
            Err((Vec::new(), ChunkProblem::Compression { name }))
        }
    };
    let (content, problem) = match unpacked {
        Ok(content) => (content, None),
        Err((read, problem)) => (Content::Unpacked(Arc::new(read)), Some(problem)),
    };
    let problem = cut.or(problem).or_else(|| wrong(&head, content.bytes()));
    (content, problem)
}

fn unpack<'a>(decoder: impl Read, size: u64) -> Result<Content<'a>, (Vec<u8>, ChunkProblem)> {
    let mut bytes = Vec::new();
    // Reads one byte more than expected, to notice a longer chunk; memory grows with the output.
    match decoder.take(size + 1).read_to_end(&mut bytes) {
        Ok(_) => Ok(Content::Unpacked(Arc::new(bytes))),
        Err(e) => Err((bytes, ChunkProblem::Unpack(e))),
    }
}

/// Size and checksum from the header; a checksum of 0 means none.
fn wrong(head: &ChunkHead, content: &[u8]) -> Option<ChunkProblem> {
    let (bytes, stated) = (content.len() as u64, head.size);
    if bytes != stated {
        return Some(ChunkProblem::Length { bytes, stated });
    }
    let differs = head.crc != 0 && crc32fast::hash(content) != head.crc;
    differs.then_some(ChunkProblem::Checksum)
}

/// The result of walking through a chunk's records.
#[derive(Default)]
pub(super) struct Walk<'a> {
    pub messages: Vec<Entry>,
    /// Schemas and channels: operation and content.
    pub definitions: Vec<(u8, &'a [u8])>,
    pub broken: Option<ChunkProblem>,
}

/// Walks through a chunk's records, up to the first incomplete one.
pub(super) fn walk(bytes: &[u8]) -> Walk<'_> {
    let mut walk = Walk::default();
    let mut at = 0;
    loop {
        let found = match record(bytes, at) {
            Ok(Some(found)) => found,
            Ok(None) => return walk,
            Err(cut) => {
                walk.broken = Some(ChunkProblem::Record(cut.problem()));
                return walk;
            }
        };
        match found.op {
            op::MESSAGE => match MessageHead::read(found.content) {
                Some(head) => walk.messages.push(Entry {
                    time: Time::from_nanos(head.log_time),
                    channel: head.channel,
                    range: found.start + MESSAGE_HEAD..found.end(),
                }),
                None => {
                    let short = RecordProblem::ShortMessage { at };
                    walk.broken = Some(ChunkProblem::Record(short));
                    return walk;
                }
            },
            op::SCHEMA | op::CHANNEL => walk.definitions.push((found.op, found.content)),
            _ => {}
        }
        at = found.end();
    }
}

/// The times of a channel's messages in one chunk, from a message index record.
pub(super) fn indexed_times(content: &[u8], channel: u16) -> Option<Vec<Time>> {
    let mut fields = Fields(content);
    if fields.u16()? != channel {
        return None;
    }
    let length = fields.u32()? as usize;
    let mut entries = Fields(fields.bytes(length)?);
    let mut times = Vec::new();
    while !entries.0.is_empty() {
        let (time, _offset) = (entries.u64()?, entries.u64()?);
        times.push(Time::from_nanos(time));
    }
    Some(times)
}
