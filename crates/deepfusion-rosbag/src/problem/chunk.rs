//! Why a chunk cannot be read.

use super::decompress::DecompressProblem;
use crate::compression::Compression;
use deepfusion_hint::count_of;

/// Why a chunk, or a part of it, cannot be read.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum ChunkProblem {
    /// The chunk is the last one of a file that was cut off.
    #[error(
        "the last chunk should have {}, {left} {} left",
        count_of(*stated, "byte"),
        if *left == 1 { "is" } else { "are" }
    )]
    Cut {
        /// Number of bytes it should have.
        stated: usize,
        /// Number of bytes left.
        left: usize,
    },
    /// The chunk is the last one, and the recorder was stopped while writing it.
    #[error("the recorder did not finish the last chunk")]
    Unfinished,
    /// The content is too long for the positions of its messages.
    #[error("the chunk is larger than 4 GiB")]
    TooLong,
    /// The compression is unknown.
    #[error("unknown compression {name}, expected none, lz4 or bz2")]
    Compression {
        /// Name of the compression, escaped.
        name: String,
    },
    /// The chunk is not compressed, and its length differs from its header's.
    #[error("{}, its header says {stated}", count_of(*bytes, "byte"))]
    StoredLength {
        /// Its length, bytes.
        bytes: usize,
        /// The length in its header, bytes.
        stated: usize,
    },
    /// The chunk takes more memory than is allowed.
    #[error("{} decompressed, the limit is {limit} (max_chunk_bytes)", count_of(*bytes, "byte"))]
    Limit {
        /// Its decompressed size in bytes, as its header says.
        bytes: usize,
        /// The limit, bytes.
        limit: usize,
    },
    /// The chunk decompresses to fewer bytes than its header says.
    #[error("{} decompressed, its header says {stated}", count_of(*bytes, "byte"))]
    Length {
        /// Number of decompressed bytes.
        bytes: usize,
        /// The size in its header, bytes.
        stated: usize,
    },
    /// The chunk cannot be decompressed.
    #[error("{}: {source}", compression.name())]
    Decompress {
        /// Compression of the chunk.
        compression: Compression,
        /// The decoder's error.
        source: DecompressProblem,
    },
}
