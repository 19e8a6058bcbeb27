//! Vector's binary log as python-can writes it (`reference/make_blf.py`), compared with the same frames as text; and damaged files.

use deepfusion_logs::{Clock, DriveLog, Error, Format, ReadOptions, Result, read};
use std::path::{Path, PathBuf};

/// Compressed with zlib, uncompressed, CAN FD, and in steps of 10 µs.
const FILES: [&str; 4] = ["vector.blf", "plain.blf", "fd.blf", "ten_microseconds.blf"];

fn fixture(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR"))
        .join("tests/reference")
        .join(name)
}

fn speeds_of(path: &Path) -> Result<DriveLog> {
    let options = ReadOptions {
        dbc: Some(fixture("vehicle.dbc")),
        speed: Some("WheelSpeeds.VehicleSpeed".into()),
        ..ReadOptions::default()
    };
    read(path, &options)
}

/// What is read from modified bytes.
fn changed(bytes: &[u8]) -> Result<DriveLog> {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("changed.blf");
    std::fs::write(&path, bytes).unwrap();
    speeds_of(&path)
}

#[test]
fn a_binary_log_has_the_speeds_of_the_same_frames_as_text() {
    let text = speeds_of(&fixture("candump.log")).unwrap();
    for name in FILES {
        let log = speeds_of(&fixture(name)).unwrap_or_else(|e| panic!("{name}: {e}"));
        assert_eq!(log.format, Format::CanTrace);
        // The header's date has no zone.
        assert_eq!(log.clock, Clock::LocalDate);
        assert_eq!(log.notes[0], text.notes[0], "{name}");
        assert_eq!(log.speeds.len(), text.speeds.len());
        // python-can keeps times as doubles, accurate to a quarter of a microsecond; the last file rounds to ten.
        let step_ns = if name == "ten_microseconds.blf" {
            10_000
        } else {
            1_000
        };
        for (ours, theirs) in log.speeds.iter().zip(&text.speeds) {
            assert_eq!(ours.mps, theirs.mps, "{name}");
            assert!(
                (ours.ns - theirs.ns).abs() <= step_ns,
                "{name}: {ours:?}, {theirs:?}"
            );
        }
    }
}

#[test]
fn a_binary_log_is_recognised_by_its_first_bytes() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("trace.bin");
    std::fs::copy(fixture("vector.blf"), &path).unwrap();
    assert_eq!(speeds_of(&path).unwrap().speeds.len(), 121);
}

#[test]
fn a_truncated_file_is_an_error_with_its_position() {
    for name in FILES {
        let bytes = std::fs::read(fixture(name)).unwrap();
        for length in (0..bytes.len()).step_by(61) {
            let mut cut = bytes[..length].to_vec();
            let Error::Bytes { offset, .. } = changed(&cut).unwrap_err() else {
                panic!("{name}, cut at {length}");
            };
            assert!(offset <= length as u64);
            // A recorder that was switched off has not written the file's size either.
            if length < 144 {
                continue;
            }
            cut[16..24].copy_from_slice(&144_u64.to_le_bytes());
            match changed(&cut) {
                // Cut between two containers, or within the zeros after one.
                Ok(log) => assert!(log.speeds.len() < 121),
                Err(Error::Bytes { offset, .. }) => {
                    assert!((144..=length as u64).contains(&offset), "{name}, {length}");
                }
                // No frame, or one.
                Err(other) => assert!(matches!(other, Error::NoSpeed { .. }), "{other}"),
            }
        }
    }
}

#[test]
fn a_damaged_file_is_an_error_with_its_byte_and_never_a_panic() {
    let bytes = std::fs::read(fixture("vector.blf")).unwrap();
    let with = |at: usize, new: &[u8]| {
        let mut changed = bytes.clone();
        changed[at..at + new.len()].copy_from_slice(new);
        changed
    };
    for (at, new, expected) in [
        (0, &b"LOGX"[..], "byte 0: LOGG: not a Vector binary log"),
        (
            4,
            &[3, 0, 0, 0],
            "byte 4: LOGG: invalid header size: 3 bytes",
        ),
        (42, &[13, 0], "byte 40: measurement start"),
        (144, b"LOBX", "byte 144: LOBJ: no object begins here"),
        (
            152,
            &[1, 0, 0, 0],
            "byte 144: LOBJ: invalid object size: 1 byte",
        ),
        (
            160,
            &[7, 0],
            "byte 144: LOG_CONTAINER: unknown compression 7",
        ),
        (
            168,
            &[1, 0, 0, 0],
            "byte 144: LOG_CONTAINER: its content has 2 bytes, its header says 1",
        ),
        (180, &[0xff; 8], "byte 144: LOG_CONTAINER: zlib"),
    ] {
        let error = changed(&with(at, new)).unwrap_err().to_string();
        assert!(error.contains(expected), "{error}, not {expected}");
    }
    // Every byte of the uncompressed form, whose objects are read directly.
    let plain = std::fs::read(fixture("plain.blf")).unwrap();
    for at in (0..plain.len()).step_by(7) {
        for flip in [0x01, 0x80, 0xff] {
            let mut bytes = plain.clone();
            bytes[at] ^= flip;
            let _ = changed(&bytes);
        }
    }
}
