use crate::mcap::McapFile;
use crate::metadata;
use crate::problem::StorageProblem;
use crate::storage::{self, Storage, hull};
use deepfusion_rosbag::{
    Connection, Error, Message, MessageIter, MessageSource, Result, Selection, SourceDamage, Time,
    TopicInfo,
};
use std::collections::VecDeque;
use std::fmt;
use std::io::ErrorKind;
use std::iter::Peekable;
use std::path::{Path, PathBuf};

/// Whether a path is a ROS 2 bag: an `.mcap` or `.db3` file, or a folder with the recorder's `metadata.yaml`.
#[must_use]
pub fn is_ros2_bag(path: &Path) -> bool {
    if path.is_dir() {
        metadata::is_bag(path)
    } else {
        path.is_file() && Kind::of(path).is_some()
    }
}

/// A ROS 2 bag, open for reading.
///
/// ```no_run
/// use deepfusion_ros2bag::Ros2Bag;
/// use deepfusion_rosbag::{MessageSource, Selection, msg::Imu};
/// # fn main() -> deepfusion_rosbag::Result<()> {
/// let bag = Ros2Bag::open("drive")?;
/// for message in bag.messages(Selection::topics(["/imu/data"]))? {
///     let message = message?;
///     let imu: Imu = message.decode()?;
///     println!("{} {:?}", message.time(), imu.linear_acceleration);
/// }
/// # Ok(())
/// # }
/// ```
#[derive(Debug)]
pub struct Ros2Bag {
    path: PathBuf,
    files: Vec<Box<dyn Storage>>,
    /// The channels of all files, in order.
    connections: Vec<Connection>,
    /// Files that `metadata.yaml` names but that do not exist.
    missing: Vec<PathBuf>,
}

/// The kind of a file, from its name.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Kind {
    Mcap,
    Sqlite,
    /// A file compressed as a whole.
    Packed,
}

impl Kind {
    fn of(path: &Path) -> Option<Self> {
        let name = path.file_name()?.to_str()?.to_ascii_lowercase();
        let ends = |endings: [&str; 2]| endings.iter().any(|e| name.ends_with(e));
        if name.ends_with(".mcap") {
            return Some(Self::Mcap);
        }
        if name.ends_with(".db3") {
            return Some(Self::Sqlite);
        }
        ends([".mcap.zstd", ".db3.zstd"]).then_some(Self::Packed)
    }
}

impl Ros2Bag {
    /// Opens a recording's folder, or one file of it. An MCAP file that is damaged or has no summary (its recorder was stopped) is
    /// scanned from the front to the damage. The readable part of a truncated database is read.
    /// [`MessageSource::damage`] reports either.
    ///
    /// MCAP files are mapped: they must not be shortened while the bag is open.
    ///
    /// # Errors
    /// [`Error::File`]; [`Error::Storage`] for files of another kind, files that are compressed as
    /// a whole, and a `metadata.yaml` that cannot be read; [`Error::Feature`] for SQLite without the feature `ros2-sqlite`.
    pub fn open(path: impl AsRef<Path>) -> Result<Self> {
        let path = path.as_ref();
        let metadata = std::fs::metadata(path).map_err(|e| Error::file(path, e))?;
        let named = if metadata.is_dir() {
            metadata::files(path)?
        } else {
            vec![path.to_owned()]
        };
        let (there, missing): (Vec<_>, Vec<_>) = named.into_iter().partition(|file| file.is_file());
        let files = there.iter().map(|file| open_file(file));
        let files: Vec<_> = files.collect::<Result<_>>()?;
        match missing.first() {
            Some(first) if files.is_empty() => Err(Error::file(first, ErrorKind::NotFound.into())),
            _ => Ok(Self {
                path: path.to_owned(),
                connections: connections_of(&files),
                files,
                missing,
            }),
        }
    }

    fn channels(&self) -> impl Iterator<Item = &storage::Channel> {
        self.files.iter().flat_map(|file| file.channels())
    }

    /// The connections of all files, one for each topic and publisher.
    pub fn connections(&self) -> impl Iterator<Item = &Connection> {
        self.connections.iter()
    }

    /// Number of messages in the bag.
    #[must_use]
    pub fn message_count(&self) -> u64 {
        self.connections().map(|c| c.count).sum()
    }
}

fn connections_of(files: &[Box<dyn Storage>]) -> Vec<Connection> {
    let channels = files.iter().flat_map(|file| file.channels());
    channels.map(|channel| channel.connection.clone()).collect()
}

fn open_file(path: &Path) -> Result<Box<dyn Storage>> {
    match Kind::of(path) {
        Some(Kind::Mcap) => Ok(Box::new(McapFile::open(path)?)),
        Some(Kind::Sqlite) => open_database(path),
        Some(Kind::Packed) => Err(StorageProblem::Packed.of(path)),
        None => Err(StorageProblem::Ending.of(path)),
    }
}

#[cfg(feature = "ros2-sqlite")]
fn open_database(path: &Path) -> Result<Box<dyn Storage>> {
    Ok(Box::new(crate::sqlite::SqliteFile::open(path)?))
}

#[cfg(not(feature = "ros2-sqlite"))]
fn open_database(path: &Path) -> Result<Box<dyn Storage>> {
    Err(Error::Feature {
        path: path.to_owned(),
        kind: "a ROS 2 bag in SQLite",
        feature: "ros2-sqlite",
    })
}

impl MessageSource for Ros2Bag {
    fn path(&self) -> &Path {
        &self.path
    }

    fn topics(&self) -> Result<Vec<TopicInfo>> {
        Ok(storage::topics(self.channels()))
    }

    fn time_range(&self) -> Option<(Time, Time)> {
        self.files.iter().map(|file| file.range()).fold(None, hull)
    }

    fn damage(&self) -> Option<SourceDamage> {
        let unreadable = self.files.iter().filter_map(|file| file.damage());
        let missing = self.missing.iter().cloned();
        let files: Vec<FileDamage> = unreadable
            .map(FileDamage::Unreadable)
            .chain(missing.map(FileDamage::NotThere))
            .collect();
        (!files.is_empty()).then(|| SourceDamage::new(BagDamage { files }))
    }

    fn messages(&self, selection: Selection) -> Result<MessageIter<'_>> {
        let mut wanted = selection.wanted(&self.connections, &self.path)?.into_iter();
        let mut waiting = Vec::new();
        for file in &self.files {
            let wanted: Vec<bool> = wanted.by_ref().take(file.channels().len()).collect();
            let Some((first, last)) = file.range() else {
                continue;
            };
            if wanted.contains(&true) && selection.overlaps(first, last) {
                waiting.push(Waiting {
                    first,
                    file: file.as_ref(),
                    wanted,
                });
            }
        }
        waiting.sort_by_key(|w| w.first);
        Ok(Box::new(InOrder {
            selection,
            waiting: waiting.into(),
            active: Vec::new(),
        }))
    }
}

struct Waiting<'a> {
    first: Time,
    file: &'a dyn Storage,
    wanted: Vec<bool>,
}

/// The messages of several files in time order. A file that begins later is not read before its time.
struct InOrder<'a> {
    selection: Selection,
    waiting: VecDeque<Waiting<'a>>,
    active: Vec<Peekable<MessageIter<'a>>>,
}

impl<'a> Iterator for InOrder<'a> {
    type Item = Result<Message<'a>>;

    fn next(&mut self) -> Option<Self::Item> {
        loop {
            self.active.retain_mut(|file| file.peek().is_some());
            // An error comes first: it has no time.
            let time = |file: &mut Peekable<MessageIter<'a>>| match file.peek() {
                Some(Ok(message)) => message.time(),
                _ => Time::ZERO,
            };
            let times = self.active.iter_mut().map(time).enumerate();
            let next = times.min_by_key(|(place, time)| (*time, *place));
            match (next, self.waiting.front()) {
                (None, None) => return None,
                (Some((place, time)), front) if front.is_none_or(|w| w.first > time) => {
                    return self.active[place].next();
                }
                _ => {
                    let Waiting { file, wanted, .. } = self.waiting.pop_front()?;
                    let messages = file.messages(wanted, &self.selection);
                    self.active.push(messages.peekable());
                }
            }
        }
    }
}

/// The damage of a ROS 2 bag: the content of its [`SourceDamage`].
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct BagDamage {
    /// The files that cannot be read, or not in full; at least one.
    pub files: Vec<FileDamage>,
}

impl fmt::Display for BagDamage {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let messages: Vec<String> = self.files.iter().map(FileDamage::to_string).collect();
        f.write_str(&messages.join("; "))
    }
}

impl std::error::Error for BagDamage {}

/// The damage of one of a bag's files.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum FileDamage {
    /// Only a part can be read: a [`McapDamage`](crate::McapDamage) or, with the feature `ros2-sqlite`, a `DatabaseDamage`.
    #[error(transparent)]
    Unreadable(SourceDamage),
    /// `metadata.yaml` names the file, but it does not exist.
    #[error("{}: no such file or folder", .0.display())]
    NotThere(PathBuf),
}
