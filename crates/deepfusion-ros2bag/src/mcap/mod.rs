//! MCAP files, mapped. The format: <https://mcap.dev/spec>.
//!
//! This crate has its own reader, as the `mcap` crate copies every chunk and stops at the first problem.

mod chunk;
mod damage;
mod definitions;
mod index;
mod messages;
mod record;
mod scan;

use crate::problem::StorageProblem;
use crate::storage::{Channel, Storage, hull};
pub use chunk::ChunkProblem;
use chunk::Entry;
pub use damage::{McapDamage, McapProblem};
use deepfusion_rosbag::{Error, MessageIter, Result, Selection, SourceDamage, Time};
use memmap2::Mmap;
use record::MAGIC;
pub use record::RecordProblem;
use std::collections::HashMap;
use std::fs::File;
use std::path::{Path, PathBuf};

/// An MCAP file, open for reading.
pub(crate) struct McapFile {
    path: PathBuf,
    bytes: Bytes,
    index: Index,
    damage: Option<SourceDamage>,
}

enum Bytes {
    Mapped(Mmap),
    Empty,
}

/// The content of a file, with positions.
#[derive(Debug, Default)]
struct Index {
    channels: Vec<Channel>,
    /// Maps a channel's number to its index in `channels`.
    places: HashMap<u16, usize>,
    chunks: Vec<ChunkInfo>,
    /// Messages outside chunks, in time order, by position in the file.
    loose: Vec<Entry>,
    problems: Vec<McapProblem>,
}

/// A chunk.
#[derive(Debug, Clone)]
struct ChunkInfo {
    /// Range of the record's content in the file.
    from: usize,
    to: usize,
    first: Time,
    last: Time,
    /// The channels of its messages, by number; `None` if unknown.
    channels: Option<Vec<u16>>,
    /// Whether it was found by a scan: it is then read up to the first malformed record.
    scanned: bool,
}

impl McapFile {
    /// Opens a file by its summary; without one, reads all of it.
    ///
    /// # Errors
    /// [`Error::File`]; [`Error::Storage`] for a file of another kind.
    pub(crate) fn open(path: &Path) -> Result<Self> {
        let failed = |e| Error::file(path, e);
        let file = File::open(path).map_err(failed)?;
        let bytes = match file.metadata().map_err(failed)?.len() {
            0 => Bytes::Empty,
            // SAFETY: the mapping is read-only and private. What remains is memmap2's caveat, stated at
            // `Ros2Bag::open`: the file must not be shortened meanwhile.
            _ => Bytes::Mapped(unsafe { Mmap::map(&file) }.map_err(failed)?),
        };
        let mut opened = Self {
            path: path.to_owned(),
            bytes,
            index: Index::default(),
            damage: None,
        };
        if !opened.bytes().starts_with(MAGIC) {
            return Err(StorageProblem::NotMcap.of(path));
        }
        opened.index = match index::read(opened.bytes()) {
            Ok(index) => index,
            Err(problem) => scan::read(opened.bytes(), problem),
        };
        let problems = std::mem::take(&mut opened.index.problems);
        if !problems.is_empty() {
            opened.damage = Some(SourceDamage::new(McapDamage { problems }));
        }
        Ok(opened)
    }

    fn bytes(&self) -> &[u8] {
        match &self.bytes {
            Bytes::Mapped(map) => map,
            Bytes::Empty => &[],
        }
    }
}

impl Storage for McapFile {
    fn channels(&self) -> &[Channel] {
        &self.index.channels
    }

    fn range(&self) -> Option<(Time, Time)> {
        let channels = self.index.channels.iter().map(|c| c.range);
        channels.fold(None, hull)
    }

    fn damage(&self) -> Option<SourceDamage> {
        self.damage.clone()
    }

    fn messages<'a>(&'a self, wanted: Vec<bool>, selection: &Selection) -> MessageIter<'a> {
        Box::new(messages::Messages::new(self, wanted, selection))
    }
}

impl std::fmt::Debug for McapFile {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("McapFile")
            .field("path", &self.path)
            .finish_non_exhaustive()
    }
}
