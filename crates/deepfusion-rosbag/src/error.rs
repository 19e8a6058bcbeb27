use crate::{BagProblem, MessageError, Time};
use deepfusion_fs::FileError;
use deepfusion_hint::{Hint, count_of};
use std::io::ErrorKind;
use std::path::{Path, PathBuf};

/// What can go wrong with a bag.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum Error {
    /// A file or folder could not be opened, read or written.
    #[error(transparent)]
    File(#[from] FileError),
    /// The file is no bag.
    #[error("{}: not a ROS bag: expected `#ROSBAG V2.0`, it begins with {found}", path.display())]
    NotABag {
        /// The file.
        path: PathBuf,
        /// Its first bytes, escaped.
        found: String,
    },
    /// The bag has another format version than 2.0.
    #[error("{}: a bag of format {version}; format 2.0 is read", path.display())]
    Version {
        /// The bag.
        path: PathBuf,
        /// Its version, such as `1.2`.
        version: String,
    },
    /// The bag's chunks are encrypted.
    #[error("{}: encrypted with {encryptor}", path.display())]
    Encrypted {
        /// The bag.
        path: PathBuf,
        /// The plugin that encrypted it.
        encryptor: String,
    },
    /// A record is not what the format says.
    #[error("{}: byte {offset}: {problem}", path.display())]
    Record {
        /// The bag.
        path: PathBuf,
        /// Where in the file.
        offset: u64,
        /// What is wrong there.
        problem: BagProblem,
    },
    /// A chunk's messages cannot be read; those of other chunks can.
    #[error("{}: chunk at byte {offset} ({}): {problem}", path.display(), count_of(*messages, "message"))]
    Chunk {
        /// The bag.
        path: PathBuf,
        /// Where the chunk begins.
        offset: u64,
        /// How many messages the index says it holds, of all topics.
        messages: u64,
        /// What is wrong with it.
        problem: BagProblem,
    },
    /// No connection has the topic asked for.
    #[error("{}: no topic {topic}; there are {}", path.display(), list(topics))]
    NoSuchTopic {
        /// The bag, or the first of a set.
        path: PathBuf,
        /// The topic asked for.
        topic: String,
        /// The topics there are.
        topics: Vec<String>,
    },
    /// A message was decoded as another type than its connection's.
    #[error("{}: {topic} holds {found}, expected {expected}", path.display())]
    WrongType {
        /// The bag.
        path: PathBuf,
        /// The message's topic.
        topic: String,
        /// The connection's type, with its MD5 where only that differs.
        found: String,
        /// The type asked for.
        expected: String,
    },
    /// A message's bytes are not what its type says.
    #[error("{}: {topic} at {time}: {type_name}: {source}", path.display())]
    Message {
        /// The bag.
        path: PathBuf,
        /// The message's topic.
        topic: String,
        /// When it was recorded.
        time: Time,
        /// Its type.
        type_name: &'static str,
        /// The field and what is wrong with it.
        source: Box<MessageError>,
    },
    /// A message or a name does not fit into the format's 32-bit lengths.
    #[error("{}: {what} of {bytes} bytes: the format holds up to {limit}", path.display())]
    TooLarge {
        /// The bag being written.
        path: PathBuf,
        /// What is too large, with its article.
        what: &'static str,
        /// Its size.
        bytes: u64,
        /// The largest size there is.
        limit: u64,
    },
    /// A connection of another writer was used.
    #[error("{}: connection {connection} was not added to this bag", path.display())]
    NoSuchConnection {
        /// The bag being written.
        path: PathBuf,
        /// The connection's number.
        connection: u32,
    },
    /// A recording of another format than ROS 1 bags cannot be read, or not all of it.
    #[error("{}: {problem}", path.display())]
    Storage {
        /// The file.
        path: PathBuf,
        /// What is wrong with it, as an error of the crate that reads this format.
        problem: Box<dyn Hint + Send + Sync>,
    },
    /// A recording of a kind whose reader is compiled in only with a feature, which is off.
    #[error("{}: it is {kind}, and this program was built without the feature `{feature}`", path.display())]
    Feature {
        /// The file.
        path: PathBuf,
        /// What it is.
        kind: &'static str,
        /// The feature, which has this name in every crate.
        feature: &'static str,
    },
    /// A set of no bags.
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
    /// An error of the system's at `path`.
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
                "a ROS 2 recording (.mcap, .db3) keeps its own ending; other files are no recordings of ROS"
            }
            Self::Version { .. } => {
                "bags from before 2010: `rosbag fix` or `rosbag reindex` of ROS 1 writes them as 2.0"
            }
            Self::Encrypted { .. } => "decrypt it first: rosbag decrypt",
            Self::Record { .. } => {
                "the file is damaged: copy it again, or open it with `ignore_index` to scan it"
            }
            Self::Chunk { .. } => {
                "copy the bag again; the messages of the other chunks can be read"
            }
            Self::NoSuchTopic { .. } => "topics are matched whole, with their leading slash",
            Self::WrongType { .. } => {
                "choose the topic by its type, or read the message's raw bytes"
            }
            Self::Message { source, .. } => return source.hint(),
            Self::TooLarge { .. } => "split it over several messages",
            Self::NoSuchConnection { .. } => "use what `add_connection` of this writer returned",
            Self::Storage { problem, .. } => return problem.hint(),
            Self::Feature { feature, .. } => {
                return Some(format!("build with the feature `{feature}` to read it"));
            }
            Self::EmptySet => return None,
        };
        Some(text.to_owned())
    }
}
