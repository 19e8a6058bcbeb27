//! A readable chunk: its bytes in the file, or a reference-counted buffer.

use crate::buffer::{Buffer, Pool};
use crate::chunk::Chunk;
use crate::compression::Compression;
use crate::index::ChunkInfo;
use crate::problem::{ChunkProblem, Fault};
use crate::source::Source;
use std::sync::Arc;

/// A chunk's content.
#[derive(Clone)]
pub(crate) enum Content {
    /// The range `from..to` of the file.
    Stored {
        from: usize,
        to: usize,
    },
    Unpacked(Arc<Buffer>),
}

impl Content {
    pub(crate) fn bytes<'a>(&'a self, file: &'a [u8]) -> &'a [u8] {
        match self {
            Self::Stored { from, to } => &file[*from..*to],
            Self::Unpacked(buffer) => buffer,
        }
    }
}

/// A chunk made readable, and the position of its index data.
pub(crate) struct ReadableChunk {
    pub content: Content,
    pub end: usize,
    /// What is wrong with a chunk of a scanned bag, whose content ends there.
    pub broken: Option<Fault>,
}

/// Makes a chunk readable, in a buffer of `pool` if it is compressed. Chunks of a scanned bag are read up to their damage.
pub(crate) fn open(
    source: &Source,
    info: &ChunkInfo,
    limit: usize,
    pool: &Arc<Pool>,
) -> Result<ReadableChunk, Fault> {
    let chunk = if info.scanned {
        Chunk::read_to_break(source, info.position)?
    } else {
        Chunk::read(source, info.position)?
    };
    let fault = |problem: ChunkProblem| Fault {
        offset: info.position,
        problem: problem.into(),
    };
    let mut broken = None;
    let content = match chunk.compression {
        Compression::None => {
            let from = chunk.end - chunk.stored.len();
            if chunk.size != chunk.stored.len() && !info.scanned {
                return Err(fault(ChunkProblem::StoredLength {
                    bytes: chunk.stored.len(),
                    stated: chunk.size,
                }));
            }
            Content::Stored {
                from,
                to: chunk.end,
            }
        }
        Compression::Lz4 | Compression::Bz2 => {
            let mut buffer = pool.take();
            match chunk.decompress(limit, &mut buffer) {
                Ok(()) => {}
                Err(problem) if info.scanned => broken = Some(fault(problem)),
                Err(problem) => return Err(fault(problem)),
            }
            Content::Unpacked(Arc::new(buffer))
        }
    };
    Ok(ReadableChunk {
        content,
        end: chunk.end,
        broken,
    })
}

/// Whether opening the chunk takes enough work for a thread.
pub(crate) fn is_compressed(source: &Source, info: &ChunkInfo) -> bool {
    let chunk = Chunk::read_to_break(source, info.position);
    chunk.is_ok_and(|chunk| chunk.compression != Compression::None)
}
