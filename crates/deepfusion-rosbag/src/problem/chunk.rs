//! Why a chunk cannot be read.

use super::decompress::DecompressProblem;
use crate::compression::Compression;
use deepfusion_hint::count_of;

/// Why a chunk cannot be read, or not all of it.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum ChunkProblem {
    /// It is the last of a file that was cut off.
    #[error(
        "the last chunk should have {}, {left} {} there",
        count_of(*stated, "byte"),
        if *left == 1 { "is" } else { "are" }
    )]
    Cut {
        /// How many bytes it should have.
        stated: usize,
        /// How many there are.
        left: usize,
    },
    /// It is the last, and the recorder was stopped while writing it.
    #[error("the recorder did not finish the last chunk")]
    Unfinished,
    /// Its content is too long for the positions of its messages.
    #[error("a chunk beyond 4 GiB")]
    TooLong,
    /// It is compressed in a way that is not read.
    #[error("compression {name}; none, lz4 and bz2 are read")]
    Compression {
        /// The compression's name, escaped.
        name: String,
    },
    /// It is stored without compression, and its header says another length.
    #[error("{}, its header says {stated}", count_of(*bytes, "byte"))]
    StoredLength {
        /// Its length.
        bytes: usize,
        /// The length in its header.
        stated: usize,
    },
    /// It takes more memory than is allowed.
    #[error("{} decompressed, the limit is {limit} (max_chunk_bytes)", count_of(*bytes, "byte"))]
    Limit {
        /// How many bytes it has decompressed, as its header says.
        bytes: usize,
        /// The limit.
        limit: usize,
    },
    /// It decompresses to less than its header says.
    #[error("{} decompressed, its header says {stated}", count_of(*bytes, "byte"))]
    Length {
        /// How many bytes came out.
        bytes: usize,
        /// The length in its header.
        stated: usize,
    },
    /// It cannot be decompressed.
    #[error("{}: {source}", compression.name())]
    Decompress {
        /// How it is compressed.
        compression: Compression,
        /// Why not.
        source: DecompressProblem,
    },
}
