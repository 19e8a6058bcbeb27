//! What is wrong with a place in a bag.

mod chunk;
mod decompress;
mod index;
mod record;

pub use self::chunk::ChunkProblem;
pub use self::decompress::{DecompressProblem, FramePart};
pub use self::index::{IndexProblem, IndexRecord};
pub use self::record::{RecordPart, RecordProblem};

/// What is wrong with a place in a bag.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum BagProblem {
    /// A record is not what the format says.
    #[error(transparent)]
    Record(#[from] RecordProblem),
    /// The index says something else than the bag.
    #[error(transparent)]
    Index(#[from] IndexProblem),
    /// A chunk cannot be read.
    #[error(transparent)]
    Chunk(#[from] ChunkProblem),
    /// It lies at another byte of the file than what it makes unreadable.
    #[error("byte {byte}: {problem}")]
    At {
        /// The byte of the file.
        byte: u64,
        /// What is wrong there.
        problem: Box<BagProblem>,
    },
    /// It lies within a chunk's content.
    #[error("in the chunk, byte {byte}: {problem}")]
    InChunk {
        /// The byte of the decompressed content.
        byte: u64,
        /// What is wrong there.
        problem: Box<BagProblem>,
    },
}

/// Something wrong at an offset, before the file's name is known.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(crate) struct Fault {
    pub offset: u64,
    pub problem: BagProblem,
}

impl Fault {
    pub(crate) fn new(offset: usize, problem: impl Into<BagProblem>) -> Self {
        Self {
            offset: offset as u64,
            problem: problem.into(),
        }
    }

    /// The problem of what begins elsewhere in the file, with the fault's own place.
    pub(crate) fn elsewhere(self) -> BagProblem {
        BagProblem::At {
            byte: self.offset,
            problem: Box::new(self.problem),
        }
    }

    /// The problem of a chunk in whose content the fault was found.
    pub(crate) fn within(self) -> BagProblem {
        BagProblem::InChunk {
            byte: self.offset,
            problem: Box::new(self.problem),
        }
    }
}
