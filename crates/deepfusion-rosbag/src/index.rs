//! The index at the end of a finished bag: its connections, and each chunk's time range and message counts.

use crate::connection::Connection;
use crate::problem::{Fault, IndexProblem, IndexRecord};
use crate::record::{Record, u32_at};
use crate::{Time, op};
use std::collections::HashMap;

/// The bag header record, the first of the file.
pub(crate) struct BagHeader {
    /// Start of the index; 0 if the recorder never wrote it.
    pub index_pos: u64,
    pub connections: u32,
    pub chunks: u32,
    pub encryptor: Option<String>,
    /// Position of the records after it.
    pub end: usize,
}

impl BagHeader {
    pub(crate) fn read(bytes: &[u8], at: usize) -> Result<Self, Fault> {
        let record = Record::read(bytes, at)?;
        record.expect_op(op::BAG_HEADER)?;
        Ok(Self {
            index_pos: record.u64("index_pos")?,
            connections: record.u32("conn_count")?,
            chunks: record.u32("chunk_count")?,
            encryptor: record.text("encryptor").ok().filter(|e| !e.is_empty()),
            end: record.end(),
        })
    }
}

/// What is known of a chunk before its data is read.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(crate) struct ChunkInfo {
    /// Position of its record.
    pub position: u64,
    pub first: Time,
    pub last: Time,
    /// Index in the list of connections, and number of messages.
    pub counts: Vec<(u32, u32)>,
    /// Whether its messages are found by walking through it, up to any damage: the bag has no index.
    pub scanned: bool,
}

impl ChunkInfo {
    pub(crate) fn messages(&self) -> u64 {
        self.counts.iter().map(|&(_, n)| u64::from(n)).sum()
    }
}

/// Connections and chunks, in the file's order.
#[derive(Default)]
pub(crate) struct Index {
    pub connections: Vec<Connection>,
    /// Maps a connection's number in the file to its index in `connections`.
    pub places: HashMap<u32, u32>,
    pub chunks: Vec<ChunkInfo>,
}

impl Index {
    /// The index section that `header` points to. The counts are not trusted: memory is allocated record by record.
    pub(crate) fn read(bytes: &[u8], header: &BagHeader) -> Result<Self, Fault> {
        let mut index = Self::default();
        let mut at = usize::try_from(header.index_pos).unwrap_or(usize::MAX);
        if at < header.end || at > bytes.len() {
            let bytes = bytes.len();
            return Err(Fault::new(bytes, IndexProblem::OutsideFile { at, bytes }));
        }
        for _ in 0..header.connections {
            let record = Record::read(bytes, at)?;
            record.expect_op(op::CONNECTION)?;
            index.add_connection(Connection::read(&record)?);
            at = record.end();
        }
        for _ in 0..header.chunks {
            let record = Record::read(bytes, at)?;
            let chunk = index.chunk_info(&record, header)?;
            index.add_chunk(chunk);
            at = record.end();
        }
        Ok(index)
    }

    /// Adds a connection unless its number is known: chunks repeat the connections of the index.
    pub(crate) fn add_connection(&mut self, connection: Connection) {
        let place = self.connections.len() as u32;
        if let std::collections::hash_map::Entry::Vacant(entry) = self.places.entry(connection.id) {
            entry.insert(place);
            self.connections.push(connection);
        }
    }

    /// Adds a chunk and its messages to the connections' counts.
    pub(crate) fn add_chunk(&mut self, chunk: ChunkInfo) {
        for &(place, count) in &chunk.counts {
            self.connections[place as usize].count += u64::from(count);
        }
        self.chunks.push(chunk);
    }

    fn chunk_info(&self, record: &Record<'_>, header: &BagHeader) -> Result<ChunkInfo, Fault> {
        record.expect_op(op::CHUNK_INFO)?;
        match record.u32("ver")? {
            1 => {}
            version => {
                return Err(record.fault(IndexProblem::Version {
                    record: IndexRecord::ChunkInformation,
                    version,
                }));
            }
        }
        let position = record.u64("chunk_pos")?;
        if position < header.end as u64 || position >= header.index_pos {
            return Err(record.fault(IndexProblem::ChunkPlace { at: position }));
        }
        let count = record.u32("count")? as usize;
        if record.data.len() as u64 != 8 * count as u64 {
            let bytes = record.data.len();
            return Err(record.fault(IndexProblem::Connections { count, bytes }));
        }
        let mut counts = Vec::with_capacity(count);
        for pair in record.data.chunks_exact(8) {
            let (id, messages) = (u32_at(pair, 0).unwrap_or(0), u32_at(pair, 4).unwrap_or(0));
            let place = self
                .places
                .get(&id)
                .ok_or_else(|| record.fault(IndexProblem::NoConnection { connection: id }))?;
            counts.push((*place, messages));
        }
        Ok(ChunkInfo {
            position,
            first: record.time("start_time")?,
            last: record.time("end_time")?,
            counts,
            scanned: false,
        })
    }
}
