use crate::connection::Connection;
use crate::index::{BagHeader, ChunkInfo, Index};
use crate::messages::Messages;
use crate::problem::Fault;
use crate::scan::{Damage, Scan, ScanReason, scan};
use crate::source::Source;
use crate::topic::{self, TopicInfo};
use crate::{Error, Result, Selection, Time};
use std::collections::HashMap;
use std::num::NonZero;
use std::path::Path;
use std::sync::Arc;

const MAGIC: &[u8] = b"#ROSBAG V";
const VERSION: &[u8] = b"2.0\n";

/// Options for opening a bag.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct BagOptions {
    /// The largest chunk that is decompressed, in bytes: a limit on the memory that a damaged or hostile file
    /// can claim for a chunk. Recorders make chunks of 768 KiB, or of one message if that is larger. 1 GiB by
    /// default.
    pub max_chunk_bytes: u64,
    /// Threads that decompress chunks ahead, for each iteration; 0 decompresses on demand. By default as many as the
    /// machine has. Bags without compression start none.
    pub threads: usize,
    /// Read the file from the front instead of by its index: for bags with a wrong index.
    pub ignore_index: bool,
}

impl Default for BagOptions {
    fn default() -> Self {
        Self {
            max_chunk_bytes: 1 << 30,
            threads: std::thread::available_parallelism().map_or(1, NonZero::get),
            ignore_index: false,
        }
    }
}

impl BagOptions {
    pub(crate) fn chunk_limit(&self) -> usize {
        usize::try_from(self.max_chunk_bytes).unwrap_or(usize::MAX)
    }
}

/// A ROS 1 bag of format 2.0, open for reading.
///
/// ```no_run
/// use deepfusion_rosbag::{Bag, Selection, msg::Imu};
/// # fn main() -> deepfusion_rosbag::Result<()> {
/// let bag = Bag::open("drive.bag")?;
/// for message in bag.messages(Selection::topics(["/imu/data"]))? {
///     let message = message?;
///     let imu: Imu = message.decode()?;
///     println!("{} {:?}", message.time(), imu.linear_acceleration);
/// }
/// # Ok(())
/// # }
/// ```
pub struct Bag {
    source: Arc<Source>,
    index: Index,
    damage: Option<Damage>,
    options: BagOptions,
}

impl std::fmt::Debug for Bag {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Bag")
            .field("path", &self.path())
            .finish_non_exhaustive()
    }
}

impl Bag {
    /// Opens a bag by its index, without touching its chunks. A bag whose index is missing or damaged is scanned from
    /// the front to the break, and [`Bag::damage`] reports it.
    ///
    /// The file is mapped. It must not be shortened while the bag is open: the system then ends the process. A bag
    /// that is still being recorded can be opened; messages appended later are not read.
    ///
    /// # Errors
    /// [`Error::File`], [`Error::NotABag`], [`Error::Version`], [`Error::Encrypted`].
    pub fn open(path: impl AsRef<Path>) -> Result<Self> {
        Self::open_with(path, BagOptions::default())
    }

    /// As [`Bag::open`], with options.
    ///
    /// # Errors
    /// As [`Bag::open`].
    pub fn open_with(path: impl AsRef<Path>, options: BagOptions) -> Result<Self> {
        Self::new(Source::map(path.as_ref())?, options)
    }

    /// Opens a bag in memory; `name` is used as its path in errors.
    ///
    /// # Errors
    /// As [`Bag::open`].
    pub fn from_bytes(name: impl AsRef<Path>, bytes: Vec<u8>, options: BagOptions) -> Result<Self> {
        Self::new(Source::memory(name.as_ref(), bytes), options)
    }

    fn new(source: Source, options: BagOptions) -> Result<Self> {
        let start = after_magic(&source)?;
        let header = BagHeader::read(&source, start);
        if let Ok(header) = &header
            && let Some(encryptor) = &header.encryptor
        {
            return Err(Error::Encrypted {
                path: source.path,
                encryptor: encryptor.clone(),
            });
        }
        let (index, damage) = match (&header, options.ignore_index) {
            (Ok(header), false) if header.index_pos != 0 => match Index::read(&source, header) {
                Ok(index) => (index, None),
                Err(fault) => rescue(&source, Ok(header), Some(fault), options),
            },
            (Ok(header), _) => rescue(&source, Ok(header), None, options),
            (Err(fault), _) => rescue(&source, Err(fault), None, options),
        };
        Ok(Self {
            source: Arc::new(source),
            index,
            damage,
            options,
        })
    }

    /// The bag's path.
    #[must_use]
    pub fn path(&self) -> &Path {
        &self.source.path
    }

    /// The connections, in the file's order. A topic has one for each publisher.
    #[must_use]
    pub fn connections(&self) -> &[Connection] {
        &self.index.connections
    }

    /// The damage of a bag whose index could not be used. `None` does not mean that every chunk is intact: chunks
    /// are checked when read.
    #[must_use]
    pub fn damage(&self) -> Option<&Damage> {
        self.damage.as_ref()
    }

    /// Number of messages in the bag.
    #[must_use]
    pub fn message_count(&self) -> u64 {
        self.connections().iter().map(|c| c.count).sum()
    }

    /// The times of the first and the last message; `None` without any.
    #[must_use]
    pub fn time_range(&self) -> Option<(Time, Time)> {
        let filled = || {
            self.index
                .chunks
                .iter()
                .filter(|chunk| chunk.messages() > 0)
        };
        let first = filled().map(|chunk| chunk.first).min()?;
        let last = filled().map(|chunk| chunk.last).max()?;
        Some((first, last))
    }

    /// The topics by name, with type, count, time range and rate. Reads the index data of the few chunks that can hold
    /// a topic's first and last message.
    ///
    /// # Errors
    /// [`Error::Chunk`] if that index data is damaged.
    pub fn topics(&self) -> Result<Vec<TopicInfo>> {
        Ok(topic::topics(self))
    }

    /// The messages that `selection` asks for, in time order.
    ///
    /// # Errors
    /// [`Error::NoSuchTopic`], naming the available topics.
    pub fn messages(&self, selection: Selection) -> Result<Messages<'_>> {
        Messages::new(self, selection)
    }

    pub(crate) fn source(&self) -> &Arc<Source> {
        &self.source
    }

    pub(crate) fn chunks(&self) -> &[ChunkInfo] {
        &self.index.chunks
    }

    pub(crate) fn places(&self) -> &HashMap<u32, u32> {
        &self.index.places
    }

    pub(crate) fn options(&self) -> BagOptions {
        self.options
    }
}

/// Where the records begin.
fn after_magic(source: &Source) -> Result<usize> {
    let line = source.get(..MAGIC.len() + VERSION.len());
    if let Some(line) = line
        && let Some(version) = line.strip_prefix(MAGIC)
    {
        if version == VERSION {
            return Ok(line.len());
        }
        let end = source
            .iter()
            .take(32)
            .position(|&b| b == b'\n')
            .unwrap_or(line.len());
        return Err(Error::Version {
            path: source.path.clone(),
            version: source[MAGIC.len()..end].escape_ascii().to_string(),
        });
    }
    let found = match source.get(..source.len().min(16)) {
        None | Some([]) => "nothing (the file is empty)".to_owned(),
        Some(bytes) => format!("`{}`", bytes.escape_ascii()),
    };
    Err(Error::NotABag {
        path: source.path.clone(),
        found,
    })
}

/// The index of a bag found by scanning it, and why that was needed. `wrong` is what was wrong with its own index.
fn rescue(
    source: &Source,
    header: std::result::Result<&BagHeader, &Fault>,
    wrong: Option<Fault>,
    options: BagOptions,
) -> (Index, Option<Damage>) {
    let Ok(header) = header else {
        // Without a bag header the start of the records is unknown.
        let fault = header.err().cloned();
        let damage = fault.map(|fault| Damage {
            offset: fault.offset,
            reason: ScanReason::BagHeader,
            problem: Some(fault.problem),
            chunks_lost: None,
            messages_without_connection: 0,
        });
        return (Index::default(), damage);
    };
    let Scan {
        index,
        broken,
        messages_without_connection,
    } = scan(source, header.end, options.chunk_limit());
    let found = index.chunks.len() as u64;
    let finished = header.index_pos != 0;
    let lost = finished.then(|| u64::from(header.chunks).saturating_sub(found));
    let asked_for = options.ignore_index && broken.is_none() && finished && wrong.is_none();
    if asked_for {
        return (index, None);
    }
    let reason = match (wrong, finished) {
        (Some(fault), _) => ScanReason::Index(fault.problem),
        (None, true) => ScanReason::AskedFor,
        (None, false) => ScanReason::NoIndex,
    };
    let (offset, problem) = match broken {
        Some(fault) => (fault.offset, Some(fault.problem)),
        None => (source.len() as u64, None),
    };
    let damage = Damage {
        offset,
        reason,
        problem,
        chunks_lost: lost,
        messages_without_connection,
    };
    (index, Some(damage))
}
