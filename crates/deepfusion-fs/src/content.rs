use std::fs::File;
use std::io::{self, Read};
use std::path::Path;

/// A file's length and checksum, to detect truncation and content lost in a power cut.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Content {
    /// Length in bytes.
    pub bytes: u64,
    /// CRC-32 as in PNG, zip and Ethernet (IEEE 802.3): against accidents, not tampering.
    pub crc32: u32,
}

impl Content {
    /// Reads a file's length and checksum.
    ///
    /// # Errors
    /// The system's error, for instance if there is no such file.
    pub fn of(path: &Path) -> io::Result<Self> {
        let mut file = File::open(path)?;
        let mut hash = crc32fast::Hasher::new();
        let mut buffer = vec![0; 1 << 16];
        let mut bytes = 0;
        loop {
            match file.read(&mut buffer)? {
                0 => break,
                n => {
                    hash.update(&buffer[..n]);
                    bytes += n as u64;
                }
            }
        }
        let crc32 = hash.finalize();
        Ok(Self { bytes, crc32 })
    }

    /// Whether a file still has this content; false for a missing file. A different length is noticed without reading.
    #[must_use]
    pub fn is_of(&self, path: &Path) -> bool {
        std::fs::metadata(path).is_ok_and(|meta| meta.len() == self.bytes)
            && Self::of(path).is_ok_and(|now| now == *self)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn content_is_identified_by_length_and_checksum() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("a");
        std::fs::write(&path, "123456789").unwrap();
        let content = Content::of(&path).unwrap();
        // The check value of CRC-32/ISO-HDLC, from Greg Cook's catalogue.
        let expected = Content {
            bytes: 9,
            crc32: 0xCBF4_3926,
        };
        assert_eq!(content, expected);
        assert!(content.is_of(&path));
        for other in [&[0_u8; 9][..], b"12345678", b"1234567890", b"123456780"] {
            std::fs::write(&path, other).unwrap();
            assert!(!content.is_of(&path), "{other:?}");
        }
        assert!(!content.is_of(&dir.path().join("none")));
    }

    #[test]
    fn a_file_longer_than_the_buffer_is_read_to_its_end() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("a");
        let bytes: Vec<u8> = (0..200_000_u32).map(|i| (i % 251) as u8).collect();
        std::fs::write(&path, &bytes).unwrap();
        let content = Content::of(&path).unwrap();
        assert_eq!(content.bytes, 200_000);
        assert_eq!(content.crc32, crc32fast::hash(&bytes));
    }
}
