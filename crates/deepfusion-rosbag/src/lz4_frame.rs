//! LZ4's frame format: <https://github.com/lz4/lz4/blob/dev/doc/lz4_Frame_format.md>.
//!
//! `lz4_flex` also decodes frames, but through two buffers of its own. Here blocks are decompressed directly to their
//! destination.

use crate::buffer::Buffer;
use crate::problem::{DecompressProblem, FramePart};
use lz4_flex::block::{decompress_into, decompress_into_with_dict};
use twox_hash::XxHash32;

/// Result of a step of decompression.
type Result<T> = std::result::Result<T, DecompressProblem>;

const MAGIC: u32 = 0x184d_2204;
/// How far back a block may refer, bytes.
const WINDOW: usize = 1 << 16;

/// Appends the decompressed frames of `stored` to `out`, up to `most` bytes in all: more is an error. Memory grows with the
/// blocks; those from before an error remain in `out`.
pub(crate) fn decompress(stored: &[u8], most: usize, out: &mut Buffer) -> Result<()> {
    let mut rest = UnreadBytes(stored);
    while !rest.0.is_empty() {
        let start = out.len();
        let header = Header::read(&mut rest)?;
        while let Some(block) = header.block(&mut rest)? {
            header.unpack(&block, start, most, out)?;
        }
        header.check(&mut rest, &out[start..])?;
    }
    Ok(())
}

struct Header {
    linked: bool,
    block_checksums: bool,
    content_checksum: bool,
    content_size: Option<u64>,
    block_most: usize,
}

struct Block<'a> {
    bytes: &'a [u8],
    packed: bool,
}

impl Header {
    fn read(rest: &mut UnreadBytes<'_>) -> Result<Self> {
        if rest.u32()? != MAGIC {
            return Err(DecompressProblem::NoFrame);
        }
        let descriptor = rest.0;
        let [flags, sizes] = rest.array()?;
        let bit = |bit: u8| flags >> bit & 1 == 1;
        if flags >> 6 != 1 || bit(0) {
            return Err(DecompressProblem::Frame);
        }
        let content_size = if bit(3) {
            Some(u64::from_le_bytes(rest.array()?))
        } else {
            None
        };
        let descriptor = &descriptor[..descriptor.len() - rest.0.len()];
        let [checksum] = rest.array()?;
        if checksum != (XxHash32::oneshot(0, descriptor) >> 8) as u8 {
            return Err(wrong_checksum(FramePart::Header));
        }
        let block_most = match sizes >> 4 & 7 {
            code @ 4..=7 => 1 << (8 + 2 * code),
            _ => return Err(DecompressProblem::BlockSize),
        };
        Ok(Self {
            linked: !bit(5),
            block_checksums: bit(4),
            content_checksum: bit(2),
            content_size,
            block_most,
        })
    }

    /// The next block; `None` at the frame's end mark.
    fn block<'a>(&self, rest: &mut UnreadBytes<'a>) -> Result<Option<Block<'a>>> {
        let length = rest.u32()?;
        if length == 0 {
            return Ok(None);
        }
        let bytes = rest.take((length & 0x7fff_ffff) as usize)?;
        if self.block_checksums && rest.u32()? != XxHash32::oneshot(0, bytes) {
            return Err(wrong_checksum(FramePart::Block));
        }
        let packed = length >> 31 == 0;
        Ok(Some(Block { bytes, packed }))
    }

    fn unpack(&self, block: &Block<'_>, start: usize, most: usize, out: &mut Buffer) -> Result<()> {
        let filled = out.len();
        let room = self.block_most.min(most - filled);
        if !block.packed {
            if block.bytes.len() > room {
                return Err(DecompressProblem::BrokenOrTooLong { most });
            }
            out.extend(block.bytes);
            return Ok(());
        }
        // LZ4 expands one byte to at most 255.
        let (before, target) = out.split(room.min(block.bytes.len().saturating_mul(255)));
        let unpacked = if self.linked {
            let window = start.max(filled.saturating_sub(WINDOW));
            decompress_into_with_dict(block.bytes, target, &before[window..])
        } else {
            decompress_into(block.bytes, target)
        };
        match unpacked {
            Ok(length) => {
                out.advance(length);
                Ok(())
            }
            Err(_) if room == most - filled => Err(DecompressProblem::BrokenOrTooLong { most }),
            Err(error) => Err(DecompressProblem::Decoder(error.to_string())),
        }
    }

    fn check(&self, rest: &mut UnreadBytes<'_>, content: &[u8]) -> Result<()> {
        if self
            .content_size
            .is_some_and(|size| size != content.len() as u64)
        {
            return Err(DecompressProblem::ContentSize);
        }
        if self.content_checksum && rest.u32()? != XxHash32::oneshot(0, content) {
            return Err(wrong_checksum(FramePart::Content));
        }
        Ok(())
    }
}

/// The bytes not read yet.
struct UnreadBytes<'a>(&'a [u8]);

impl<'a> UnreadBytes<'a> {
    fn take(&mut self, count: usize) -> Result<&'a [u8]> {
        let (taken, rest) = self
            .0
            .split_at_checked(count)
            .ok_or(DecompressProblem::Cut)?;
        self.0 = rest;
        Ok(taken)
    }

    fn array<const N: usize>(&mut self) -> Result<[u8; N]> {
        let (taken, rest) = self.0.split_first_chunk().ok_or(DecompressProblem::Cut)?;
        self.0 = rest;
        Ok(*taken)
    }

    fn u32(&mut self) -> Result<u32> {
        self.array().map(u32::from_le_bytes)
    }
}

fn wrong_checksum(part: FramePart) -> DecompressProblem {
    DecompressProblem::Checksum { part }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::buffer::Pool;
    use lz4_flex::frame::{BlockMode, BlockSize, FrameEncoder, FrameInfo};
    use std::io::Write;

    /// Four blocks and a bit, whose matches refer back into the block before.
    fn content() -> Vec<u8> {
        let tile: Vec<u8> = (0..999_u32).map(|i| ((i * i) >> 5) as u8).collect();
        tile.iter()
            .cycle()
            .take(4 * 65_536 + 1234)
            .copied()
            .collect()
    }

    fn frame(mode: BlockMode, content: &[u8]) -> Vec<u8> {
        let info = FrameInfo::new()
            .block_mode(mode)
            .block_size(BlockSize::Max64KB)
            .block_checksums(true)
            .content_checksum(true)
            .content_size(Some(content.len() as u64));
        let mut encoder = FrameEncoder::with_frame_info(info, Vec::new());
        encoder.write_all(content).unwrap();
        encoder.finish().unwrap()
    }

    fn unpack(stored: &[u8], most: usize) -> (Vec<u8>, Option<String>) {
        let mut out = Pool::new(0).take();
        let error = decompress(stored, most, &mut out).err();
        (out.to_vec(), error.map(|error| error.to_string()))
    }

    #[test]
    fn independent_blocks_linked_blocks_and_several_frames_are_read() {
        let content = content();
        for mode in [BlockMode::Independent, BlockMode::Linked] {
            let stored = frame(mode, &content);
            assert_eq!(unpack(&stored, content.len()), (content.clone(), None));
            let twice = [&stored[..], &stored].concat();
            assert_eq!(
                unpack(&twice, usize::MAX),
                ([&content[..], &content].concat(), None)
            );
        }
    }

    #[test]
    fn a_truncated_or_too_long_frame_gives_its_beginning() {
        let content = content();
        let stored = frame(BlockMode::Linked, &content);
        for cut in 1..stored.len() {
            let (found, error) = unpack(&stored[..cut], content.len());
            assert!(
                error.is_some() && content.starts_with(&found),
                "cut at {cut}"
            );
        }
        for most in [0, 1, 65_535, 65_536, 65_537, content.len() - 1] {
            let (found, error) = unpack(&stored, most);
            assert!(found.len() <= most && content.starts_with(&found));
            assert!(error.unwrap().contains(&most.to_string()));
        }
    }

    #[test]
    fn no_changed_bit_goes_unnoticed() {
        let content = content();
        let stored = frame(BlockMode::Independent, &content);
        for at in 0..stored.len() {
            let mut changed = stored.clone();
            changed[at] ^= 1 << (at % 8);
            assert!(unpack(&changed, content.len()).1.is_some(), "byte {at}");
        }
    }
}
