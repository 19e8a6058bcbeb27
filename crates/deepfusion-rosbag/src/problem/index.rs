//! How an index contradicts its bag.

use crate::Time;
use deepfusion_hint::count_of;
use std::fmt;

/// How the index contradicts the bag.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum IndexProblem {
    /// The index cannot begin at the given position.
    #[error("the index should be at byte {at}, the file has {bytes}")]
    OutsideFile {
        /// The position in the bag header.
        at: usize,
        /// The file's length, bytes.
        bytes: usize,
    },
    /// A record of the index has an unsupported version.
    #[error("{record} of version {version}, expected 1")]
    Version {
        /// Kind of the record.
        record: IndexRecord,
        /// Version of the record.
        version: u32,
    },
    /// The index names a chunk at an impossible position.
    #[error("a chunk at byte {at}, outside of the bag's chunks")]
    ChunkPlace {
        /// The position of the chunk.
        at: u64,
    },
    /// A chunk's list of connections has the wrong length.
    #[error(
        "expected {} of 8 bytes each, found {}",
        count_of(*count, "connection"),
        count_of(*bytes, "byte")
    )]
    Connections {
        /// Number of connections there should be.
        count: usize,
        /// Length of the list, bytes.
        bytes: usize,
    },
    /// The index names a connection that the bag does not have.
    #[error("connection {connection} is not among the bag's connections")]
    NoConnection {
        /// The connection's number.
        connection: u32,
    },
    /// A chunk has index data of a connection that it should not contain.
    #[error("index data of connection {connection}, which the chunk should not have")]
    StrayData {
        /// The connection's number.
        connection: u32,
    },
    /// A chunk's index data has another number of messages than the index says.
    #[error(
        "index data of {} in {}, the index says {promised}",
        count_of(*count, "message"),
        count_of(*bytes, "byte")
    )]
    Data {
        /// Number of messages in the index data.
        count: usize,
        /// Length of the index data, bytes.
        bytes: usize,
        /// Number of messages in the index.
        promised: u32,
    },
    /// A message is not the one that the index says.
    #[error(
        "the index has a message of connection {connection} at {time}, the chunk one of {found} at {found_time}"
    )]
    OtherMessage {
        /// The connection in the index.
        connection: u32,
        /// The time in the index.
        time: Time,
        /// The message's connection.
        found: u32,
        /// The message's time.
        found_time: Time,
    },
    /// A chunk has a message before its first one.
    #[error("a message at {time}, the index says the first is at {first}")]
    Early {
        /// Time of the message.
        time: Time,
        /// Time of the first message according to the index.
        first: Time,
    },
}

/// A record of an index that has a version.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[non_exhaustive]
pub enum IndexRecord {
    /// A chunk's record in the index at the end of the bag.
    ChunkInformation,
    /// The positions of a chunk's messages of one connection, after the chunk.
    IndexData,
}

impl fmt::Display for IndexRecord {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::ChunkInformation => "chunk information",
            Self::IndexData => "index data",
        })
    }
}
