//! A bag without a usable index: reads every record from the front to the first damage.

use crate::Time;
use crate::buffer::Pool;
use crate::chunk::Chunk;
use crate::connection::Connection;
use crate::content::{self, Content};
use crate::entry::{Walk, walk};
use crate::index::{ChunkInfo, Index};
use crate::op;
use crate::problem::{BagProblem, ChunkProblem, Fault, RecordProblem};
use crate::record::Record;
use crate::source::Source;
use rayon::prelude::*;
use std::fmt;
use std::sync::Arc;

/// The damage of a bag that was scanned instead of opened by its index.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Damage {
    /// The byte of the file where its records end, or the position of the first one that cannot be read.
    pub offset: u64,
    /// Why it was scanned.
    pub reason: ScanReason,
    /// What is wrong at that byte; `None` if every record up to the end was read.
    pub problem: Option<BagProblem>,
    /// Number of chunks in the bag's header beyond those found; `None` if the recorder never wrote the count.
    pub chunks_lost: Option<u64>,
    /// Number of messages found that cannot be assigned, because the record of their connection is lost. Messages
    /// that were never written, or come after the damage, are not counted.
    pub messages_without_connection: u64,
}

/// Why a bag was scanned instead of opened by its index.
#[derive(Debug, Clone, PartialEq, Eq)]
#[non_exhaustive]
pub enum ScanReason {
    /// The caller asked to ignore the index.
    AskedFor,
    /// Its header cannot be read, so that the start of the records is unknown.
    BagHeader,
    /// Its index cannot be read.
    Index(BagProblem),
    /// The recorder was stopped before it wrote an index.
    NoIndex,
}

/// Beginning of the message, before the problem that ended the scan.
impl fmt::Display for ScanReason {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::AskedFor => Ok(()),
            Self::BagHeader => f.write_str("the bag header: "),
            Self::Index(problem) => write!(f, "the index cannot be read ({problem}): "),
            Self::NoIndex => {
                f.write_str("the recorder did not finish the bag, which has no index: ")
            }
        }
    }
}

impl fmt::Display for Damage {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "byte {}: {}", self.offset, self.reason)?;
        match &self.problem {
            Some(problem) => write!(f, "{problem}")?,
            None => f.write_str("every record up to the end was read")?,
        }
        match self.chunks_lost {
            Some(0) | None => {}
            Some(1) => write!(f, "; 1 chunk is lost")?,
            Some(n) => write!(f, "; {n} chunks are lost")?,
        }
        match self.messages_without_connection {
            0 => Ok(()),
            1 => write!(f, "; 1 message belongs to a connection that is lost"),
            n => write!(f, "; {n} messages belong to connections that are lost"),
        }
    }
}

impl std::error::Error for Damage {}

/// The result of a scan: an index, and the first damage.
pub(crate) struct Scan {
    pub index: Index,
    pub broken: Option<Fault>,
    pub messages_without_connection: u64,
}

/// Reads every record from `start`. Chunks are decompressed on all threads, one at a time on each; only their
/// time ranges and counts are kept.
pub(crate) fn scan(source: &Source, start: usize, limit: usize) -> Scan {
    let frames = Frames::find(source, start);
    let pool = Pool::new(rayon::current_num_threads());
    let chunks: Vec<_> = frames
        .chunks
        .into_par_iter()
        .map(|position| ScannedChunk::read(source, position, limit, &pool))
        .collect();
    let mut index = Index::default();
    // Definitions in the chunks come first: that is the order in which the recorder first saw the topics.
    for found in &chunks {
        found
            .connections
            .iter()
            .for_each(|c| index.add_connection(c.clone()));
    }
    frames
        .connections
        .into_iter()
        .for_each(|c| index.add_connection(c));
    let mut broken = frames.broken;
    let mut strays = 0;
    for found in chunks {
        if let Some(fault) = found.broken
            && broken
                .as_ref()
                .is_none_or(|first| fault.offset < first.offset)
        {
            broken = Some(fault);
        }
        let mut info = found.info;
        info.counts
            .retain_mut(|(connection, count)| match index.places.get(connection) {
                Some(&place) => {
                    *connection = place;
                    true
                }
                None => {
                    strays += u64::from(*count);
                    false
                }
            });
        if !info.counts.is_empty() {
            index.add_chunk(info);
        }
    }
    Scan {
        index,
        broken,
        messages_without_connection: strays,
    }
}

/// The records of the file itself, without looking into chunks.
#[derive(Default)]
struct Frames {
    chunks: Vec<u64>,
    connections: Vec<Connection>,
    broken: Option<Fault>,
}

impl Frames {
    fn find(bytes: &[u8], start: usize) -> Self {
        let mut frames = Self::default();
        let mut at = start;
        while at < bytes.len() && frames.broken.is_none() {
            match frames.step(bytes, at) {
                Ok(end) => at = end,
                Err(fault) => frames.broken = Some(fault),
            }
        }
        frames
    }

    fn step(&mut self, bytes: &[u8], at: usize) -> Result<usize, Fault> {
        let record = Record::read_header(bytes, at)?;
        if record.op() == Some(op::CHUNK) {
            let chunk = Chunk::read_to_break(bytes, at as u64)?;
            self.chunks.push(at as u64);
            if record.data.len() < record.data_len {
                let problem = ChunkProblem::Cut {
                    stated: record.data_len,
                    left: record.data.len(),
                };
                self.broken = Some(Fault::new(bytes.len(), problem));
            } else if chunk.size == usize::MAX {
                self.broken = Some(Fault::new(bytes.len(), ChunkProblem::Unfinished));
            }
            return Ok(chunk.end);
        }
        let record = Record::read(bytes, at)?;
        match record.op() {
            Some(op::CONNECTION) => self.connections.push(Connection::read(&record)?),
            Some(op::INDEX_DATA | op::CHUNK_INFO) => {}
            Some(op) => return Err(record.fault(RecordProblem::Misplaced { op })),
            None => return Err(record.fault(RecordProblem::NoRecord)),
        }
        Ok(record.end())
    }
}

/// The result of scanning a chunk; its counts are by connection number, as in the file.
struct ScannedChunk {
    info: ChunkInfo,
    connections: Vec<Connection>,
    broken: Option<Fault>,
}

impl ScannedChunk {
    fn read(source: &Source, position: u64, limit: usize, pool: &Arc<Pool>) -> Self {
        let mut info = ChunkInfo {
            position,
            first: Time::ZERO,
            last: Time::ZERO,
            counts: Vec::new(),
            scanned: true,
        };
        let (walk, broken) = match content::open(source, &info, limit, pool) {
            Ok(opened) => {
                let walk = walk(opened.content.bytes(source));
                let inner = walk.broken.clone().map(|fault| match opened.content {
                    Content::Stored { from, .. } => Fault {
                        offset: from as u64 + fault.offset,
                        ..fault
                    },
                    // A byte of a compressed chunk's content has no position in the file; the chunk's own is used.
                    Content::Unpacked(_) => Fault {
                        offset: position,
                        problem: fault.within(),
                    },
                });
                (walk, opened.broken.or(inner))
            }
            Err(fault) => (Walk::default(), Some(fault)),
        };
        for &(connection, time, _) in &walk.messages {
            match info.counts.iter_mut().find(|(c, _)| *c == connection) {
                Some((_, count)) => *count += 1,
                None => info.counts.push((connection, 1)),
            }
            info.last = info.last.max(time);
        }
        let first = walk.messages.iter().map(|&(_, time, _)| time).min();
        info.first = first.unwrap_or_default();
        Self {
            info,
            connections: walk.connections,
            broken,
        }
    }
}
