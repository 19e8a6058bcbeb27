//! A chunk record: its bytes as they are, or decompressed.

use crate::buffer::Buffer;
use crate::compression::Compression;
use crate::op;
use crate::problem::{ChunkProblem, Fault};
use crate::record::Record;

/// A chunk as it is stored in the file.
pub(crate) struct Chunk<'a> {
    pub compression: Compression,
    /// Its decompressed size in bytes, as its header says.
    pub size: usize,
    pub stored: &'a [u8],
    /// Position of the records after it.
    pub end: usize,
}

impl<'a> Chunk<'a> {
    pub(crate) fn read(bytes: &'a [u8], position: u64) -> Result<Self, Fault> {
        Self::from_record(&Record::read(bytes, place(position))?)
    }

    /// Reads a chunk that may be cut off: `stored` is the part that exists. It is all the rest if the recorder wrote the header but
    /// was stopped before filling in the length.
    pub(crate) fn read_to_break(bytes: &'a [u8], position: u64) -> Result<Self, Fault> {
        let record = Record::read_header(bytes, place(position))?;
        let mut chunk = Self::from_record(&record)?;
        if record.data_len == 0 && !another_follows(bytes, record.data_at) {
            chunk.stored = &bytes[record.data_at..];
            chunk.end = bytes.len();
            chunk.size = usize::MAX;
        }
        Ok(chunk)
    }

    fn from_record(record: &Record<'a>) -> Result<Self, Fault> {
        record.expect_op(op::CHUNK)?;
        let name = record.fields.get("compression").unwrap_or(b"none");
        let compression = Compression::from_name(name).ok_or_else(|| {
            let name = name.escape_ascii().to_string();
            record.fault(ChunkProblem::Compression { name })
        })?;
        Ok(Self {
            compression,
            size: record.u32("size")? as usize,
            stored: record.data,
            end: record.end(),
        })
    }

    /// The decompressed bytes. Memory grows with the output, never beyond `limit` or the size that the
    /// header gives; output from before an error remains in `out`.
    pub(crate) fn decompress(&self, limit: usize, out: &mut Buffer) -> Result<(), ChunkProblem> {
        let stated = self.size;
        if stated != usize::MAX && stated > limit {
            let bytes = stated;
            return Err(ChunkProblem::Limit { bytes, limit });
        }
        let compression = self.compression;
        compression
            .decompress(self.stored, stated.min(limit), out)
            .map_err(|source| ChunkProblem::Decompress {
                compression,
                source,
            })?;
        let bytes = out.len();
        if stated != usize::MAX && bytes < stated {
            return Err(ChunkProblem::Length { bytes, stated });
        }
        Ok(())
    }
}

fn place(position: u64) -> usize {
    usize::try_from(position).unwrap_or(usize::MAX)
}

/// Whether a record that may follow a chunk begins at `at`, so that the chunk before it is indeed empty.
fn another_follows(bytes: &[u8], at: usize) -> bool {
    let next = Record::read_header(bytes, at)
        .ok()
        .and_then(|record| record.op());
    matches!(next, Some(op::CHUNK | op::INDEX_DATA | op::CHUNK_INFO))
}
