//! Why a chunk's content cannot be decompressed.

use deepfusion_hint::count_of;
use std::fmt;

/// Why a chunk's content cannot be decompressed.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum DecompressProblem {
    /// The content is longer than allowed.
    #[error("more than the {} expected", count_of(*most, "byte"))]
    TooLong {
        /// Allowed number of bytes.
        most: usize,
    },
    /// A block is longer than allowed, or damaged so that it seems to be.
    #[error("damaged, or more than the {} expected", count_of(*most, "byte"))]
    BrokenOrTooLong {
        /// Allowed number of bytes of the content.
        most: usize,
    },
    /// The data ends too early.
    #[error("unexpected end of file")]
    Cut,
    /// The data does not begin with an LZ4 frame.
    #[error("not an LZ4 frame")]
    NoFrame,
    /// The LZ4 frame needs features that are not supported.
    #[error("unsupported LZ4 frame: another version, or with a dictionary")]
    Frame,
    /// The block size of an LZ4 frame is unknown.
    #[error("unknown block size")]
    BlockSize,
    /// The content has another size than the LZ4 frame's header says.
    #[error("the content has another size than the frame header says")]
    ContentSize,
    /// A checksum is wrong.
    #[error("{part} checksum is wrong")]
    Checksum {
        /// The part whose checksum is wrong.
        part: FramePart,
    },
    /// The decoder's message; its error itself can be neither cloned nor compared.
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

/// Written as a genitive.
impl fmt::Display for FramePart {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Header => "the frame header's",
            Self::Block => "a block's",
            Self::Content => "the content's",
        })
    }
}
