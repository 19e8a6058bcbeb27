//! A decompressed chunk, and the positions of its messages.

use super::record::{ChunkHead, Fields, MESSAGE_HEAD, MessageHead, op, record};
use crate::storage::MOST_BYTES;
use deepfusion_rosbag::Time;
use std::io::Read;
use std::ops::Range;
use std::sync::Arc;

/// A chunk's records: in the file itself, or unpacked.
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
    /// Its own bytes.
    pub range: Range<usize>,
}

/// Decompresses the chunk whose record's content is `content`; on an error it returns what was read up to there, and the reason.
pub(super) fn open(content: &[u8]) -> (Content<'_>, Option<String>) {
    let Some(head) = ChunkHead::read(content) else {
        let problem = "its head is cut off".to_owned();
        return (Content::Stored(&[]), Some(problem));
    };
    let stored = &content[head.length..];
    let whole = usize::try_from(head.stored)
        .ok()
        .and_then(|n| stored.get(..n));
    let cut = whole.is_none().then(|| {
        let missing = head.stored - stored.len() as u64;
        format!("{missing} of its {} bytes are missing", head.stored)
    });
    let stored = whole.unwrap_or(stored);
    if head.size > MOST_BYTES {
        let size = head.size;
        let problem = format!("{size} bytes unpacked, at most {MOST_BYTES} are read");
        return (Content::Stored(&[]), Some(problem));
    }
    let unpacked = match head.compression.as_str() {
        "" | "none" => Ok(Content::Stored(stored)),
        "lz4" => unpack(lz4_flex::frame::FrameDecoder::new(stored), head.size),
        "zstd" => match zstd::stream::read::Decoder::with_buffer(stored) {
            Ok(decoder) => unpack(decoder, head.size),
            Err(e) => Err((Vec::new(), e.to_string())),
        },
        other => {
            let problem = format!("compression `{other}`: none, lz4 and zstd are read");
            Err((Vec::new(), problem))
        }
    };
    let (content, problem) = match unpacked {
        Ok(content) => (content, None),
        Err((read, problem)) => (Content::Unpacked(Arc::new(read)), Some(problem)),
    };
    let problem = cut.or(problem).or_else(|| wrong(&head, content.bytes()));
    (content, problem)
}

fn unpack<'a>(decoder: impl Read, size: u64) -> Result<Content<'a>, (Vec<u8>, String)> {
    let mut bytes = Vec::new();
    // One byte more than there should be, so that too many are seen; memory grows with what comes.
    match decoder.take(size + 1).read_to_end(&mut bytes) {
        Ok(_) => Ok(Content::Unpacked(Arc::new(bytes))),
        Err(e) => Err((bytes, format!("cannot be unpacked: {e}"))),
    }
}

/// Size and checksum from the header; a checksum of 0 means none.
fn wrong(head: &ChunkHead, bytes: &[u8]) -> Option<String> {
    if bytes.len() as u64 != head.size {
        return Some(format!(
            "{} bytes unpacked, its head says {}",
            bytes.len(),
            head.size
        ));
    }
    let differs = head.crc != 0 && crc32fast::hash(bytes) != head.crc;
    differs.then(|| "its checksum differs".to_owned())
}

/// The result of walking through a chunk's records.
#[derive(Default)]
pub(super) struct Walk<'a> {
    pub messages: Vec<Entry>,
    /// Schemas and channels: operation and content.
    pub definitions: Vec<(u8, &'a [u8])>,
    pub broken: Option<String>,
}

/// Goes through a chunk's records, up to the first that is not whole.
pub(super) fn walk(bytes: &[u8]) -> Walk<'_> {
    let mut walk = Walk::default();
    let mut at = 0;
    loop {
        let found = match record(bytes, at) {
            Ok(Some(found)) => found,
            Ok(None) => return walk,
            Err(cut) => {
                walk.broken = Some(format!("unpacked, {}", cut.problem()));
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
                    walk.broken = Some(format!("unpacked, the message at byte {at} is too short"));
                    return walk;
                }
            },
            op::SCHEMA | op::CHANNEL => walk.definitions.push((found.op, found.content)),
            _ => {}
        }
        at = found.end();
    }
}

/// The times of a channel's messages in one chunk, by a message index record.
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
