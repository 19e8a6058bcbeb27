//! Why a chunk's content cannot be decompressed.

use deepfusion_hint::count_of;
use std::fmt;

/// Why a chunk's content cannot be decompressed.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum DecompressProblem {
    /// It is longer than it may be.
    #[error("more than the {} expected", count_of(*most, "byte"))]
    TooLong {
        /// How many bytes it may have.
        most: usize,
    },
    /// A block is longer than it may be, or damaged so that it seems to be.
    #[error("broken, or more than the {} expected", count_of(*most, "byte"))]
    BrokenOrTooLong {
        /// How many bytes the content may have.
        most: usize,
    },
    /// It ends too early.
    #[error("unexpected end of file")]
    Cut,
    /// It does not begin as an LZ4 frame.
    #[error("no LZ4 frame begins here")]
    NoFrame,
    /// It is an LZ4 frame that is not read.
    #[error("an LZ4 frame of another version, or with a dictionary")]
    Frame,
    /// The size of an LZ4 frame's blocks is none of those there are.
    #[error("an unknown block size")]
    BlockSize,
    /// The content has another size than the LZ4 frame says.
    #[error("the content has another size than the frame header says")]
    ContentSize,
    /// A checksum differs.
    #[error("{part} checksum is wrong")]
    Checksum {
        /// Whose.
        part: FramePart,
    },
    /// What the decoder said, whose own error cannot be kept: it is not to be cloned or compared.
    #[error("{0}")]
    Decoder(String),
}

/// A part of an LZ4 frame that has a checksum.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[non_exhaustive]
pub enum FramePart {
    /// The frame's header.
    Header,
    /// A block.
    Block,
    /// The content of all blocks.
    Content,
}

/// In the genitive.
impl fmt::Display for FramePart {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Header => "the frame header's",
            Self::Block => "a block's",
            Self::Content => "the content's",
        })
    }
}
