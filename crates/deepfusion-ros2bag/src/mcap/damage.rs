//! What is wrong with an MCAP file that was scanned.

use super::chunk::ChunkProblem;
use super::record::RecordProblem;
use std::fmt;

/// What is wrong with an MCAP file that was scanned instead of opened by its summary.
#[derive(Debug)]
pub struct McapDamage {
    /// In the order in which it was found; at least one.
    pub problems: Vec<McapProblem>,
}

impl fmt::Display for McapDamage {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let said: Vec<String> = self.problems.iter().map(McapProblem::to_string).collect();
        f.write_str(&said.join("; "))
    }
}

impl std::error::Error for McapDamage {}

/// What is wrong with a place of an MCAP file.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum McapProblem {
    /// The recorder was stopped before it wrote a summary.
    #[error("the recorder did not finish the file, it has no summary")]
    NoSummary,
    /// Its end does not say where the summary is.
    #[error("the file's end is damaged")]
    End,
    /// The summary should begin where it cannot.
    #[error("the summary is damaged: it begins behind its end")]
    SummaryPlace,
    /// A record of the summary is not whole.
    #[error("the summary is damaged: {0}")]
    SummaryCut(RecordProblem),
    /// A record of the summary is not what the format says.
    #[error("the summary is damaged: the record at byte {at}")]
    SummaryRecord {
        /// Where it begins.
        at: usize,
    },
    /// What describes a topic or its messages is cut off.
    #[error("the definition at byte {at} is cut off")]
    Definition {
        /// Where it begins, in the file or in its chunk.
        at: usize,
    },
    /// A record is not whole.
    #[error(transparent)]
    Record(RecordProblem),
    /// A chunk cannot be read, or not all of it.
    #[error("the chunk at byte {at}: {problem}")]
    Chunk {
        /// Where it begins.
        at: usize,
        /// What is wrong with it.
        problem: ChunkProblem,
    },
}
