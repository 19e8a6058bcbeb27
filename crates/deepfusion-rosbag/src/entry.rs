//! The positions of a chunk's messages, from the index data after it or by walking through its content.

use crate::Time;
use crate::connection::Connection;
use crate::index::ChunkInfo;
use crate::op;
use crate::problem::{ChunkProblem, Fault, IndexProblem, IndexRecord};
use crate::record::{self, Record, u32_at};
use std::collections::HashMap;

/// A message within a chunk.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct Entry {
    pub time: Time,
    /// Index in the list of connections.
    pub connection: u32,
    /// Position of its record in the chunk's content.
    pub offset: u32,
}

/// The messages of a chunk from the index data records at `at`, the end of the chunk. `wanted` selects connections by
/// index; the entries of others are skipped unread.
pub(crate) fn indexed(
    bytes: &[u8],
    mut at: usize,
    info: &ChunkInfo,
    places: &HashMap<u32, u32>,
    wanted: impl Fn(u32) -> bool,
) -> Result<Vec<Entry>, Fault> {
    let mut entries = Vec::new();
    for _ in 0..info.counts.len() {
        let record = Record::read(bytes, at)?;
        at = record.end();
        record.expect_op(op::INDEX_DATA)?;
        match record.u32("ver")? {
            1 => {}
            version => {
                return Err(record.fault(IndexProblem::Version {
                    record: IndexRecord::IndexData,
                    version,
                }));
            }
        }
        let (id, count) = (record.u32("conn")?, record.u32("count")? as usize);
        let place = places.get(&id).copied();
        let promised = info.counts.iter().find(|(p, _)| Some(*p) == place);
        let Some(&(place, promised)) = promised else {
            return Err(record.fault(IndexProblem::StrayData { connection: id }));
        };
        if record.data.len() as u64 != 12 * count as u64 || promised as usize != count {
            return Err(record.fault(IndexProblem::Data {
                count,
                bytes: record.data.len(),
                promised,
            }));
        }
        if wanted(place) {
            entries.extend(record.data.chunks_exact(12).map(|entry| Entry {
                time: stamp(entry),
                connection: place,
                offset: u32_at(entry, 8).unwrap_or(u32::MAX),
            }));
        }
    }
    Ok(entries)
}

fn stamp(entry: &[u8]) -> Time {
    entry
        .first_chunk()
        .map_or(Time::ZERO, |time| record::time(*time))
}

/// The result of walking through a chunk's content.
#[derive(Default)]
pub(crate) struct Walk {
    /// The connection records in it; a chunk has those of connections that were first used in it.
    pub connections: Vec<Connection>,
    /// Connection number in the file, time and offset of each message up to the break.
    pub messages: Vec<(u32, Time, u32)>,
    /// What ended the walk before the content's end.
    pub broken: Option<Fault>,
}

/// Walks through a chunk's content, record by record, to its end or its break.
pub(crate) fn walk(content: &[u8]) -> Walk {
    let mut walk = Walk::default();
    let mut at = 0;
    while at < content.len() {
        match step(content, at, &mut walk) {
            Ok(end) => at = end,
            Err(fault) => {
                walk.broken = Some(fault);
                break;
            }
        }
    }
    walk
}

fn step(content: &[u8], at: usize, walk: &mut Walk) -> Result<usize, Fault> {
    let record = Record::read(content, at)?;
    match record.op() {
        Some(op::CONNECTION) => walk.connections.push(Connection::read(&record)?),
        _ => {
            let (connection, time) = record.message()?;
            let offset = u32::try_from(at).map_err(|_| record.fault(ChunkProblem::TooLong))?;
            walk.messages.push((connection, time, offset));
        }
    }
    Ok(record.end())
}

impl Walk {
    /// The messages whose connection is known.
    pub(crate) fn entries(&self, places: &HashMap<u32, u32>) -> Vec<Entry> {
        let known = |&(id, time, offset): &(u32, Time, u32)| {
            let connection = *places.get(&id)?;
            Some(Entry {
                time,
                connection,
                offset,
            })
        };
        self.messages.iter().filter_map(known).collect()
    }
}

/// The bytes of the message at `entry`, after checking that it matches the entry.
pub(crate) fn message<'a>(content: &'a [u8], entry: &Entry, id: u32) -> Result<&'a [u8], Fault> {
    let mut record = Record::read(content, entry.offset as usize)?;
    // Some recorders' offsets point to the connection's record before its first message.
    while record.op() == Some(op::CONNECTION) {
        record = Record::read(content, record.end())?;
    }
    let (connection, time) = record.message()?;
    if (connection, time) != (id, entry.time) {
        return Err(record.fault(IndexProblem::OtherMessage {
            connection: id,
            time: entry.time,
            found: connection,
            found_time: time,
        }));
    }
    Ok(record.data)
}
