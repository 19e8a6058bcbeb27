//! LZ4 frames and bzip2, both ways.

use bzip2::bufread::MultiBzDecoder;
use bzip2::write::BzEncoder;
use lz4_flex::frame::{BlockMode, BlockSize, FrameDecoder, FrameEncoder, FrameInfo};
use std::borrow::Cow;
use std::io::{self, BufRead, Read, Write};

/// How a chunk's bytes are compressed.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Default)]
pub enum Compression {
    /// Not at all: read without copying.
    #[default]
    None,
    /// LZ4 frames: fast both ways.
    Lz4,
    /// bzip2: smaller still, slow both ways.
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

    /// Appends what `stored` holds to `out`, up to `most` bytes: more is an error. Memory grows with what comes out, and
    /// what came out before an error stays.
    pub(crate) fn decompress(
        self,
        stored: &[u8],
        most: usize,
        out: &mut Vec<u8>,
    ) -> io::Result<()> {
        match self {
            Compression::None => extend(out, stored, most),
            Compression::Lz4 => {
                // LZ4 makes at most 255 bytes of one: a small chunk cannot ask for a large buffer.
                out.reserve_exact(most.min(stored.len().saturating_mul(255)));
                drain(FrameDecoder::new(stored), most, out)
            }
            Compression::Bz2 => read_all(MultiBzDecoder::new(stored), most, out),
        }
    }
}

/// A chunk's content as it is stored.
pub(crate) fn compress(compression: Compression, content: &[u8]) -> io::Result<Cow<'_, [u8]>> {
    match compression {
        Compression::None => Ok(content.into()),
        Compression::Lz4 => {
            // What ROS's own decoder insists on: independent blocks, a checksum at the end, no size in front.
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

fn extend(out: &mut Vec<u8>, bytes: &[u8], most: usize) -> io::Result<()> {
    if bytes.len() > most - out.len() {
        return Err(io::Error::other(format!(
            "more than the {most} bytes expected"
        )));
    }
    out.extend_from_slice(bytes);
    Ok(())
}

/// From a decoder that has a buffer of its own: one copy, no zeroing.
fn drain(mut decoder: impl BufRead, most: usize, out: &mut Vec<u8>) -> io::Result<()> {
    loop {
        let block = decoder.fill_buf()?;
        if block.is_empty() {
            return Ok(());
        }
        let length = block.len();
        extend(out, block, most)?;
        decoder.consume(length);
    }
}

/// From a decoder that writes into ours, which doubles as it fills.
fn read_all(mut decoder: impl Read, most: usize, out: &mut Vec<u8>) -> io::Result<()> {
    const FIRST: usize = 1 << 20;
    let mut filled = 0;
    loop {
        if filled == out.len() {
            // One byte more than promised is asked for, so that a longer stream is noticed.
            let room = (2 * filled).max(FIRST).min(most.saturating_add(1));
            out.resize(room.max(filled), 0);
        }
        if filled == out.len() {
            out.truncate(most);
            return Err(io::Error::other(format!(
                "more than the {most} bytes expected"
            )));
        }
        match decoder.read(&mut out[filled..]) {
            Ok(0) => break out.truncate(filled),
            Ok(n) => filled += n,
            Err(error) if error.kind() == io::ErrorKind::Interrupted => {}
            Err(error) => {
                out.truncate(filled);
                return Err(error);
            }
        }
    }
    Ok(())
}
