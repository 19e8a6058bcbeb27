//! TensorBoard's event files. A record is a length, its checksum, an `Event` protobuf message and its checksum. Only scalars are written,
//! so the two messages are encoded by hand.

use crate::Error;
use std::fs::{File, OpenOptions};
use std::io::Write;
use std::path::{Path, PathBuf};
use std::time::{SystemTime, UNIX_EPOCH};

/// An event file of scalars.
#[derive(Debug)]
pub struct TensorBoardLog {
    file: File,
    path: PathBuf,
}

impl TensorBoardLog {
    /// A new event file in the folder. TensorBoard reads all files of a folder in the order of their
    /// names, so a resumed run simply adds one.
    ///
    /// # Errors
    /// [`Error::Model`].
    pub fn create(folder: &Path) -> Result<Self, Error> {
        let now = seconds();
        let path = folder.join(format!(
            "events.out.tfevents.{:010}.deepfusion.{}",
            now as u64,
            std::process::id()
        ));
        let file = OpenOptions::new().create(true).append(true).open(&path);
        let mut log = Self {
            file: file.map_err(|e| Error::io(&path, "write", e))?,
            path,
        };
        // Field 3: the file's version, which TensorBoard expects first.
        let mut event = double(1, now);
        event.extend(bytes(3, b"brain.Event:2"));
        log.record(&event)?;
        Ok(log)
    }

    /// Appends scalars of a step.
    ///
    /// # Errors
    /// [`Error::Model`].
    pub fn scalars(&mut self, step: usize, values: &[(&str, f64)]) -> Result<(), Error> {
        let mut summary = Vec::new();
        for (tag, value) in values {
            let mut entry = bytes(1, tag.as_bytes());
            entry.extend(float(2, *value as f32));
            summary.extend(bytes(1, &entry));
        }
        let mut event = double(1, seconds());
        event.push(2 << 3);
        event.extend(varint(step as u64));
        event.extend(bytes(5, &summary));
        self.record(&event)
    }

    fn record(&mut self, event: &[u8]) -> Result<(), Error> {
        let length = (event.len() as u64).to_le_bytes();
        let mut record = length.to_vec();
        record.extend(masked_crc(&length).to_le_bytes());
        record.extend(event);
        record.extend(masked_crc(event).to_le_bytes());
        self.file
            .write_all(&record)
            .map_err(|e| Error::io(&self.path, "write", e))
    }
}

fn seconds() -> f64 {
    SystemTime::now()
        .duration_since(UNIX_EPOCH)
        .map_or(0.0, |d| d.as_secs_f64())
}

fn varint(mut value: u64) -> Vec<u8> {
    let mut out = Vec::new();
    while value >= 0x80 {
        out.push(value as u8 | 0x80);
        value >>= 7;
    }
    out.push(value as u8);
    out
}

fn double(field: u8, value: f64) -> Vec<u8> {
    [&[field << 3 | 1][..], &value.to_le_bytes()].concat()
}

fn float(field: u8, value: f32) -> Vec<u8> {
    [&[field << 3 | 5][..], &value.to_le_bytes()].concat()
}

fn bytes(field: u8, value: &[u8]) -> Vec<u8> {
    [&[field << 3 | 2][..], &varint(value.len() as u64), value].concat()
}

/// CRC-32C (Castagnoli), rotated and offset as TFRecord requires.
fn masked_crc(data: &[u8]) -> u32 {
    let crc = data.iter().fold(u32::MAX, |crc, byte| {
        (0..8).fold(crc ^ u32::from(*byte), |crc, _| {
            (crc >> 1) ^ (0x82F6_3B78 & (crc & 1).wrapping_neg())
        })
    });
    (!crc).rotate_right(15).wrapping_add(0xA282_EAD8)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The check value of CRC-32C over "123456789" is 0xE3069283 (RFC 3720's polynomial).
    #[test]
    fn the_checksum_is_crc_32c() {
        let crc = 0xE306_9283_u32;
        let masked = crc.rotate_right(15).wrapping_add(0xA282_EAD8);
        assert_eq!(masked_crc(b"123456789"), masked);
    }

    #[test]
    fn records_are_framed() {
        let folder = tempfile::tempdir().unwrap();
        let mut log = TensorBoardLog::create(folder.path()).unwrap();
        log.scalars(300, &[("loss/total", 0.5)]).unwrap();
        let data = std::fs::read(&log.path).unwrap();
        let mut rest = data.as_slice();
        let mut events = Vec::new();
        while !rest.is_empty() {
            let length = u64::from_le_bytes(rest[..8].try_into().unwrap()) as usize;
            assert_eq!(masked_crc(&rest[..8]).to_le_bytes(), rest[8..12]);
            let event = &rest[12..12 + length];
            assert_eq!(
                masked_crc(event).to_le_bytes(),
                rest[12 + length..16 + length]
            );
            events.push(event.to_vec());
            rest = &rest[16 + length..];
        }
        assert_eq!(events.len(), 2);
        assert!(events[0].ends_with(b"brain.Event:2"));
        // Field 2, varint 300; then the tag, then 0.5 as a float.
        assert_eq!(events[1][9..12], [2 << 3, 0xAC, 0x02]);
        assert!(events[1].windows(10).any(|w| w == b"loss/total"));
        assert!(events[1].ends_with(&0.5_f32.to_le_bytes()));
    }
}
