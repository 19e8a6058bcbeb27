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

/// Why a file of a ROS 2 bag cannot be read, or not all of it: what [`Error::Storage`] of such a bag holds.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum StorageProblem {
    /// The file is compressed as a whole.
    #[error("the whole file is compressed (zstd), so that nothing in it can be found")]
    Packed,
    /// Its name has the ending of no kind that is read.
    #[error("neither .mcap nor .db3")]
    Ending,
    /// It does not begin as an MCAP file.
    #[error("not an MCAP file: it does not begin as one")]
    NotMcap,
    /// `metadata.yaml` does not name the recording's files.
    #[error("{KEY}: {}", first_line(.0))]
    Metadata(#[source] Box<serde_saphyr::Error>),
    /// A chunk of an MCAP file cannot be read.
    #[error("the chunk at byte {at}: {problem}")]
    Chunk {
        /// Where it begins in the file.
        at: usize,
        /// What is wrong with it.
        problem: ChunkProblem,
    },
    /// A message of an MCAP file that was compressed by itself cannot be unpacked.
    #[error("{topic}, a message of {time}: {problem}")]
    PackedMessage {
        /// Its topic.
        topic: String,
        /// When it was recorded.
        time: Time,
        /// What is wrong with it.
        problem: PackedProblem,
    },
    /// SQLite cannot read the database.
    #[cfg(feature = "ros2-sqlite")]
    #[error("{}", sqlite::said(.0))]
    Sqlite(#[source] rusqlite::Error),
    /// A message of a database cannot be unpacked.
    #[cfg(feature = "ros2-sqlite")]
    #[error("{topic}, row {row}: {problem}")]
    Message {
        /// Its topic.
        topic: String,
        /// Its row of the table `messages`.
        row: i64,
        /// What is wrong with it.
        problem: PackedProblem,
    },
}

/// The parser's other lines show the text about the place.
fn first_line(e: &serde_saphyr::Error) -> String {
    let text = e.to_string();
    text.lines().next().unwrap_or_default().to_owned()
}

impl StorageProblem {
    /// The error of a file.
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
                "unpack it first: zstd -d FILE; `ros2 bag record --compression-mode message` keeps files open to reading"
            }
            Self::Ending => "give the recording's folder, or one of its .mcap or .db3 files",
            Self::NotMcap => "give the recording's own .mcap file",
            Self::Metadata(_) => "`ros2 bag reindex FOLDER` writes it anew",
            Self::Chunk { .. } => COPY_AGAIN,
            Self::PackedMessage { .. } => "the message is damaged",
            #[cfg(feature = "ros2-sqlite")]
            Self::Sqlite(e) => sqlite::hint(e),
            #[cfg(feature = "ros2-sqlite")]
            Self::Message { .. } => "the message is damaged",
        };
        Some(text.to_owned())
    }
}
