//! Why a file of a ROS 2 bag cannot be read.

#[cfg(feature = "ros2-sqlite")]
mod sqlite;

use crate::mcap::ChunkProblem;
use crate::packed::PackedProblem;
use crate::storage::COPY_AGAIN;
use deepfusion_hint::Hint;
use deepfusion_rosbag::{Error, Time};
use std::path::Path;

/// The only key of `metadata.yaml` that is read.
pub(crate) const KEY: &str = "rosbag2_bagfile_information";

/// Why a file of a ROS 2 bag, or a part of it, cannot be read: the content of an [`Error::Storage`] of such a bag.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum StorageProblem {
    /// The file is compressed as a whole.
    #[error("the whole file is compressed (zstd) and cannot be searched")]
    Packed,
    /// The name of the file has an unknown ending.
    #[error("the name ends in neither .mcap nor .db3")]
    Ending,
    /// The file does not begin as an MCAP file.
    #[error("not an MCAP file: it does not begin with the format's magic bytes")]
    NotMcap,
    /// `metadata.yaml` does not name the recording's files.
    #[error("{KEY}: {}", first_line(.0))]
    Metadata(#[source] Box<serde_saphyr::Error>),
    /// A chunk of an MCAP file cannot be read.
    #[error("the chunk at byte {at}: {problem}")]
    Chunk {
        /// Position of the chunk in the file.
        at: usize,
        /// What is wrong with the chunk.
        problem: ChunkProblem,
    },
    /// A separately compressed message of an MCAP file cannot be decompressed.
    #[error("{topic}, message at {time}: {problem}")]
    PackedMessage {
        /// Topic of the message.
        topic: String,
        /// Time at which the message was recorded.
        time: Time,
        /// What is wrong with the message.
        problem: PackedProblem,
    },
    /// SQLite cannot read the database.
    #[cfg(feature = "ros2-sqlite")]
    #[error("{}", sqlite::message(.0))]
    Sqlite(#[source] rusqlite::Error),
    /// A message of a database cannot be decompressed.
    #[cfg(feature = "ros2-sqlite")]
    #[error("{topic}, row {row}: {problem}")]
    Message {
        /// Topic of the message.
        topic: String,
        /// Row of the message in the table `messages`.
        row: i64,
        /// What is wrong with the message.
        problem: PackedProblem,
    },
}

/// The first line of a parser's message; the other lines show the text around the error.
fn first_line(e: &serde_saphyr::Error) -> String {
    let text = e.to_string();
    text.lines().next().unwrap_or_default().to_owned()
}

impl StorageProblem {
    /// Makes it an error about a file.
    pub(crate) fn of(self, path: &Path) -> Error {
        Error::Storage {
            path: path.to_owned(),
            problem: Box::new(self),
        }
    }
}

impl Hint for StorageProblem {
    fn hint(&self) -> Option<String> {
        let text = match self {
            Self::Packed => {
                "decompress it first with `zstd -d FILE`; record with `ros2 bag record --compression-mode message`, whose files can be read"
            }
            Self::Ending => "give the recording's folder, or one of its .mcap or .db3 files",
            Self::NotMcap => "give the recording's own .mcap file",
            Self::Metadata(_) => "write it again with `ros2 bag reindex FOLDER`",
            Self::Chunk { .. } => COPY_AGAIN,
            Self::PackedMessage { .. } => "copy the file again: the message is damaged",
            #[cfg(feature = "ros2-sqlite")]
            Self::Sqlite(e) => sqlite::hint(e),
            #[cfg(feature = "ros2-sqlite")]
            Self::Message { .. } => "copy the file again: the message is damaged",
        };
        Some(text.to_owned())
    }
}
