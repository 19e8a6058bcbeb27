//! How an index contradicts its bag.

use crate::Time;
use deepfusion_hint::count_of;
use std::fmt;

/// How the index contradicts the bag.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum IndexProblem {
    /// It should begin where the bag cannot have one.
    #[error("the index should be at byte {at}, the file has {bytes}")]
    OutsideFile {
        /// Where it should begin.
        at: usize,
        /// The file's length.
        bytes: usize,
    },
    /// A record of it has another version than is read.
    #[error("{record} of version {version}, expected 1")]
    Version {
        /// Which record.
        record: IndexRecord,
        /// Its version.
        version: u32,
    },
    /// It names a chunk where no chunk can be.
    #[error("a chunk at byte {at}, outside of the bag's chunks")]
    ChunkPlace {
        /// Where the chunk should begin.
        at: u64,
    },
    /// A chunk's list of connections has another length than it should.
    #[error(
        "{} of 8 bytes, but {}",
        count_of(*count, "connection"),
        count_of(*bytes, "byte")
    )]
    Connections {
        /// How many connections there should be.
        count: usize,
        /// The list's length.
        bytes: usize,
    },
    /// It names a connection that the bag does not have.
    #[error("connection {connection} is not among the bag's connections")]
    NoConnection {
        /// The connection's number.
        connection: u32,
    },
    /// A chunk has index data of a connection that it should not hold.
    #[error("index data of connection {connection}, which the chunk should not hold")]
    StrayData {
        /// The connection's number.
        connection: u32,
    },
    /// A chunk's index data is of another number of messages than the index says.
    #[error(
        "index data of {} in {}, the index says {promised}",
        count_of(*count, "message"),
        count_of(*bytes, "byte")
    )]
    Data {
        /// How many messages it says to have.
        count: usize,
        /// Its length.
        bytes: usize,
        /// How many messages the index says.
        promised: u32,
    },
    /// A message is another one than the index says.
    #[error(
        "the index has a message of connection {connection} at {time}, the chunk one of {found} at {found_time}"
    )]
    OtherMessage {
        /// The connection that the index says.
        connection: u32,
        /// The time that the index says.
        time: Time,
        /// The message's connection.
        found: u32,
        /// The message's time.
        found_time: Time,
    },
    /// A chunk has a message before its first one.
    #[error("a message at {time}, the index says the first is at {first}")]
    Early {
        /// The message's time.
        time: Time,
        /// The first message's time by the index.
        first: Time,
    },
}

/// A record of an index that has a version.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[non_exhaustive]
pub enum IndexRecord {
    /// What the index at the end of the bag says of a chunk.
    ChunkInformation,
    /// Where a chunk's messages of one connection are, behind the chunk.
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
