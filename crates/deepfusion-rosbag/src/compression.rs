//! Compression and decompression of LZ4 frames and bzip2.

use crate::buffer::Buffer;
use crate::lz4_frame;
use crate::problem::DecompressProblem;
use bzip2::bufread::MultiBzDecoder;
use bzip2::write::BzEncoder;
use lz4_flex::frame::{BlockMode, BlockSize, FrameEncoder, FrameInfo};
use std::borrow::Cow;
use std::io::{self, Read, Write};

/// The compression of a chunk.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Default)]
pub enum Compression {
    /// No compression: read without copying.
    #[default]
    None,
    /// LZ4 frames: fast to write and to read.
    Lz4,
    /// bzip2: smaller still, slow to write and to read.
    Bz2,
}

impl Compression {
    /// Its name in the file.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::None => "none",
            Self::Lz4 => "lz4",
            Self::Bz2 => "bz2",
        }
    }

    pub(crate) fn from_name(name: &[u8]) -> Option<Self> {
        [Self::None, Self::Lz4, Self::Bz2]
            .into_iter()
            .find(|c| c.name().as_bytes() == name)
    }

    /// Appends the decompressed `stored` to `out`, up to `most` bytes: more is an error. Memory grows with the output, and
    /// output from before an error remains.
    pub(crate) fn decompress(
        self,
        stored: &[u8],
        most: usize,
        out: &mut Buffer,
    ) -> Result<(), DecompressProblem> {
        match self {
            Compression::None => extend(out, stored, most),
            Compression::Lz4 => lz4_frame::decompress(stored, most, out),
            Compression::Bz2 => read_all(MultiBzDecoder::new(stored), most, out),
        }
    }
}

/// Compresses a chunk's content.
pub(crate) fn compress(compression: Compression, content: &[u8]) -> io::Result<Cow<'_, [u8]>> {
    match compression {
        Compression::None => Ok(content.into()),
        Compression::Lz4 => {
            // ROS's own decoder requires independent blocks, a checksum at the end, and no size at the front.
            let frame = FrameInfo::new()
                .block_mode(BlockMode::Independent)
                .block_size(BlockSize::Max1MB)
                .content_checksum(true);
            let mut encoder = FrameEncoder::with_frame_info(frame, Vec::new());
            encoder.write_all(content)?;
            Ok(encoder.finish()?.into())
        }
        Compression::Bz2 => {
            let mut encoder = BzEncoder::new(Vec::new(), bzip2::Compression::best());
            encoder.write_all(content)?;
            Ok(encoder.finish()?.into())
        }
    }
}

fn extend(out: &mut Buffer, bytes: &[u8], most: usize) -> Result<(), DecompressProblem> {
    if bytes.len() > most - out.len() {
        return Err(DecompressProblem::TooLong { most });
    }
    out.extend(bytes);
    Ok(())
}

/// Reads all that a decoder gives, one mebibyte at a time.
fn read_all(
    mut decoder: impl Read,
    most: usize,
    out: &mut Buffer,
) -> Result<(), DecompressProblem> {
    const STEP: usize = 1 << 20;
    loop {
        // One byte more than expected is read, so that a longer stream is noticed.
        let room = STEP.min((most - out.len()).saturating_add(1));
        match decoder.read(out.split(room).1) {
            Ok(0) => return Ok(()),
            Ok(count) if count > most - out.len() => {
                return Err(DecompressProblem::TooLong { most });
            }
            Ok(count) => out.advance(count),
            Err(error) if error.kind() == io::ErrorKind::Interrupted => {}
            Err(error) => return Err(DecompressProblem::Decoder(error.to_string())),
        }
    }
}
