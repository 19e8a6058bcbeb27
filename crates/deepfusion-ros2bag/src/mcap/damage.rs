//! What is wrong with an MCAP file that was scanned.

use super::chunk::ChunkProblem;
use super::record::RecordProblem;
use std::fmt;

/// What is wrong with an MCAP file that was scanned instead of opened by its summary.
#[derive(Debug)]
pub struct McapDamage {
    /// The problems in the order in which they were found; at least one.
    pub problems: Vec<McapProblem>,
}

impl fmt::Display for McapDamage {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let messages: Vec<String> = self.problems.iter().map(McapProblem::to_string).collect();
        f.write_str(&messages.join("; "))
    }
}

impl std::error::Error for McapDamage {}

/// A problem at a position of an MCAP file.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum McapProblem {
    /// The recorder was stopped before it wrote a summary.
    #[error("the recorder did not finish the file, which has no summary")]
    NoSummary,
    /// The end of the file does not give the position of the summary.
    #[error("the file's end is damaged")]
    End,
    /// The position of the summary is impossible.
    #[error("the summary is damaged: its start is after its end")]
    SummaryPlace,
    /// A record of the summary is incomplete.
    #[error("the summary is damaged: {0}")]
    SummaryCut(RecordProblem),
    /// A record of the summary does not have the required form.
    #[error("the summary is damaged: the record at byte {at}")]
    SummaryRecord {
        /// Position of the record.
        at: usize,
    },
    /// The definition of a topic or its messages is cut off.
    #[error("the definition at byte {at} is cut off")]
    Definition {
        /// Position of the definition, in the file or in its chunk.
        at: usize,
    },
    /// A record is incomplete.
    #[error(transparent)]
    Record(RecordProblem),
    /// A chunk, or a part of it, cannot be read.
    #[error("the chunk at byte {at}: {problem}")]
    Chunk {
        /// Position of the chunk.
        at: usize,
        /// What is wrong with the chunk.
        problem: ChunkProblem,
    },
}
