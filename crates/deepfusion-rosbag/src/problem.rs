//! What is wrong at a position in a bag.

mod chunk;
mod decompress;
mod index;
mod record;

pub use self::chunk::ChunkProblem;
pub use self::decompress::{DecompressProblem, FramePart};
pub use self::index::{IndexProblem, IndexRecord};
pub use self::record::{RecordPart, RecordProblem};

/// What is wrong at a position in a bag.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum BagProblem {
    /// A record does not have the required form.
    #[error(transparent)]
    Record(#[from] RecordProblem),
    /// The index contradicts the bag.
    #[error(transparent)]
    Index(#[from] IndexProblem),
    /// A chunk cannot be read.
    #[error(transparent)]
    Chunk(#[from] ChunkProblem),
    /// The fault lies at another byte of the file than the part that it makes unreadable.
    #[error("byte {byte}: {problem}")]
    At {
        /// Position in the file.
        byte: u64,
        /// What is wrong at this position.
        problem: Box<BagProblem>,
    },
    /// The fault lies within a chunk's content.
    #[error("in the chunk, byte {byte}: {problem}")]
    InChunk {
        /// Position in the decompressed content.
        byte: u64,
        /// What is wrong at this position.
        problem: Box<BagProblem>,
    },
}

/// A problem at an offset, before the file's name is known.
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

    /// The same problem for something that begins elsewhere in the file; the fault's own position is kept.
    pub(crate) fn elsewhere(self) -> BagProblem {
        BagProblem::At {
            byte: self.offset,
            problem: Box::new(self.problem),
        }
    }

    /// The problem of a chunk whose content has the fault.
    pub(crate) fn within(self) -> BagProblem {
        BagProblem::InChunk {
            byte: self.offset,
            problem: Box::new(self.problem),
        }
    }
}
