use crate::{BagProblem, MessageError, Time};
use deepfusion_fs::FileError;
use deepfusion_hint::{Hint, count_of};
use std::io::ErrorKind;
use std::path::{Path, PathBuf};

/// Why a bag cannot be read or written.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum Error {
    /// A file or folder could not be opened, read or written.
    #[error(transparent)]
    File(#[from] FileError),
    /// The file is not a bag.
    #[error("{}: not a ROS bag: it begins with {found}, expected `#ROSBAG V2.0`", path.display())]
    NotABag {
        /// Path of the file.
        path: PathBuf,
        /// Its first bytes, escaped.
        found: String,
    },
    /// The bag has another format version than 2.0.
    #[error("{}: bag format {version}, expected 2.0", path.display())]
    Version {
        /// Path of the bag.
        path: PathBuf,
        /// Its version, such as `1.2`.
        version: String,
    },
    /// The bag's chunks are encrypted.
    #[error("{}: encrypted with {encryptor}", path.display())]
    Encrypted {
        /// Path of the bag.
        path: PathBuf,
        /// Name of the plugin that encrypted it.
        encryptor: String,
    },
    /// A record does not have the required form.
    #[error("{}: byte {offset}: {problem}", path.display())]
    Record {
        /// Path of the bag.
        path: PathBuf,
        /// Position in the file.
        offset: u64,
        /// What is wrong with the record.
        problem: BagProblem,
    },
    /// A chunk's messages cannot be read; those of other chunks can.
    #[error("{}: chunk at byte {offset} ({}): {problem}", path.display(), count_of(*messages, "message"))]
    Chunk {
        /// Path of the bag.
        path: PathBuf,
        /// Position of the chunk in the file.
        offset: u64,
        /// Number of messages in the chunk according to the index, of all topics.
        messages: u64,
        /// What is wrong with the chunk.
        problem: BagProblem,
    },
    /// No connection has the requested topic.
    #[error("{}: no topic {topic}; available: {}", path.display(), list(topics))]
    NoSuchTopic {
        /// Path of the bag, or of the first one of a set.
        path: PathBuf,
        /// The requested topic.
        topic: String,
        /// The existing topics.
        topics: Vec<String>,
    },
    /// A message was decoded as another type than its connection's.
    #[error("{}: {topic} has messages of type {found}, expected {expected}", path.display())]
    WrongType {
        /// Path of the bag.
        path: PathBuf,
        /// The message's topic.
        topic: String,
        /// The connection's type, with its MD5 if only that differs.
        found: String,
        /// The requested type.
        expected: String,
    },
    /// A message's bytes do not fit its type.
    #[error("{}: {topic} at {time}: {type_name}: {source}", path.display())]
    Message {
        /// Path of the bag.
        path: PathBuf,
        /// The message's topic.
        topic: String,
        /// The time at which it was recorded.
        time: Time,
        /// The message's type.
        type_name: &'static str,
        /// The field and what is wrong with it.
        source: Box<MessageError>,
    },
    /// A message or a name does not fit into the format's 32-bit lengths.
    #[error("{}: {what} of {bytes} bytes: the format allows at most {limit}", path.display())]
    TooLarge {
        /// Path of the bag being written.
        path: PathBuf,
        /// What is too large, with its article.
        what: &'static str,
        /// Its size in bytes.
        bytes: u64,
        /// The largest allowed size in bytes.
        limit: u64,
    },
    /// A connection that another writer returned was used.
    #[error("{}: connection {connection} was not added to this bag", path.display())]
    NoSuchConnection {
        /// Path of the bag being written.
        path: PathBuf,
        /// The connection's number.
        connection: u32,
    },
    /// A recording in another format than ROS 1 bags cannot be read, or not all of it.
    #[error("{}: {problem}", path.display())]
    Storage {
        /// Path of the file.
        path: PathBuf,
        /// The error of the crate that reads this format.
        problem: Box<dyn Hint + Send + Sync>,
    },
    /// The reader of this kind of recording is behind a feature that is off.
    #[error("{}: it is {kind}, and this program was built without the feature `{feature}`", path.display())]
    Feature {
        /// Path of the file.
        path: PathBuf,
        /// Kind of the recording.
        kind: &'static str,
        /// The feature, which has this name in every crate.
        feature: &'static str,
    },
    /// The set has no bags.
    #[error("a set of bags needs at least one bag")]
    EmptySet,
}

/// A result with this crate's [`Error`].
pub type Result<T> = std::result::Result<T, Error>;

fn list(names: &[String]) -> String {
    match names {
        [] => "none".to_owned(),
        names => names.join(", "),
    }
}

impl Error {
    /// An error of the operating system about `path`.
    #[must_use]
    pub fn file(path: &Path, source: std::io::Error) -> Self {
        FileError::new(path, source).into()
    }
}

impl Hint for Error {
    fn hint(&self) -> Option<String> {
        let text = match self {
            Self::File(FileError::Io { source, .. })
                if source.kind() == ErrorKind::IsADirectory =>
            {
                "give the .bag file itself"
            }
            Self::File(error) => return error.hint(),
            Self::NotABag { .. } => {
                "name ROS 2 recordings .mcap or .db3; other files are not ROS recordings"
            }
            Self::Version { .. } => {
                "convert bags from before 2010 with `rosbag fix` or `rosbag reindex` of ROS 1"
            }
            Self::Encrypted { .. } => "decrypt it first, with `rosbag decrypt`",
            Self::Record { .. } => {
                "the file is damaged: copy it again, or open it with `ignore_index` to scan it"
            }
            Self::Chunk { .. } => {
                "copy the bag again; the messages of the other chunks can be read"
            }
            Self::NoSuchTopic { .. } => "give the topic's full name, with its leading slash",
            Self::WrongType { .. } => {
                "choose the topic by its type, or read the message's raw bytes"
            }
            Self::Message { source, .. } => return source.hint(),
            Self::TooLarge { .. } => "split it over several messages",
            Self::NoSuchConnection { .. } => {
                "use a connection that `add_connection` of this writer returned"
            }
            Self::Storage { problem, .. } => return problem.hint(),
            Self::Feature { feature, .. } => {
                return Some(format!("build with the feature `{feature}` to read it"));
            }
            Self::EmptySet => return None,
        };
        Some(text.to_owned())
    }
}
