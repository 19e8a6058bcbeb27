//! Messages that were compressed one by one (`ros2 bag record --compression-mode message`), in either storage.

use crate::storage::MOST_BYTES;
use std::io::{self, Read};

/// The first bytes of a Zstandard frame, with which a CDR message never begins.
const ZSTD: [u8; 4] = [0x28, 0xb5, 0x2f, 0xfd];

/// Why a separately compressed message cannot be decompressed.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum PackedProblem {
    /// The message is larger than allowed.
    #[error("{MOST_BYTES} bytes or more decompressed")]
    TooLarge,
    /// The decoder cannot be set up.
    #[error("{0}")]
    Decoder(#[source] io::Error),
    /// The compressed bytes are damaged.
    #[error("cannot be decompressed: {0}")]
    Unpack(#[source] io::Error),
}

/// Whether a CDR message is compressed.
pub(crate) fn is_packed(bytes: &[u8]) -> bool {
    bytes.starts_with(&ZSTD)
}

/// Decompresses a message.
pub(crate) fn unpack(bytes: &[u8]) -> Result<Vec<u8>, PackedProblem> {
    let mut message = Vec::new();
    let decoder =
        zstd::stream::read::Decoder::with_buffer(bytes).map_err(PackedProblem::Decoder)?;
    let read = decoder.take(MOST_BYTES).read_to_end(&mut message);
    match read {
        Ok(_) if (message.len() as u64) < MOST_BYTES => Ok(message),
        Ok(_) => Err(PackedProblem::TooLarge),
        Err(e) => Err(PackedProblem::Unpack(e)),
    }
}
