//! Bags that we write: the bytes that `reference/check_written.py` saw PyPI's `rosbags` accept, value by value, and
//! read back by ourselves.

use crate::common::{Lines, lines, read_json, sha256};
use crate::written;
use deepfusion_rosbag::msg::{Float32, Imu};
use deepfusion_rosbag::{
    Bag, BagWriter, Compression, Error, FileError, Selection, Time, WriterOptions,
};
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

const COMPRESSIONS: [Compression; 3] = [Compression::None, Compression::Lz4, Compression::Bz2];

#[test]
fn the_bytes_are_those_that_rosbags_accepted() {
    let accepted: BTreeMap<String, String> = read_json("written.json");
    let kept = std::env::var_os("DEEPFUSION_WRITE_BAGS").map(PathBuf::from);
    let folder = tempfile::tempdir().unwrap();
    for compression in COMPRESSIONS {
        let name = format!("written_{}.bag", compression.name());
        let path = kept.as_deref().unwrap_or(folder.path()).join(&name);
        let values = written::write(&path, compression);
        if kept.is_some() {
            // For check_written.py, which decides whether these bytes are right.
            std::fs::write(
                path.with_extension("json"),
                serde_json::to_vec(&values).unwrap(),
            )
            .unwrap();
            continue;
        }
        let found = sha256(std::fs::read(&path).unwrap());
        assert_eq!(
            found, accepted[&name],
            "{name} changed: run tests/reference/check_written.py"
        );
    }
}

#[test]
fn written_bags_are_read_back() {
    let folder = tempfile::tempdir().unwrap();
    for compression in COMPRESSIONS {
        let path = folder.path().join("a.bag");
        let mut written = serde_json::to_value(written::write(&path, compression)).unwrap();
        let written = written.as_array_mut().unwrap();
        written.sort_by_key(|message| message["time"].as_u64());
        let bag = Bag::open(&path).unwrap();
        assert_eq!(bag.message_count(), written.len() as u64);
        let mut messages = bag.messages(Selection::all()).unwrap();
        for expected in written {
            let message = messages.next().unwrap().unwrap();
            assert_eq!(message.topic(), expected["topic"]);
            assert_eq!(message.time().nanos(), expected["time"]);
            assert_eq!(
                serde_json::to_value(lines(&message)).unwrap(),
                expected["values"],
                "{message:?}"
            );
        }
        assert!(messages.next().is_none());
    }
}

fn names(folder: &Path) -> Vec<String> {
    let entries = std::fs::read_dir(folder).unwrap();
    entries
        .map(|e| e.unwrap().file_name().into_string().unwrap())
        .collect()
}

#[test]
fn the_bag_appears_when_it_is_finished() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.bag");
    for finish in [false, true] {
        let mut bag = BagWriter::create(&path, WriterOptions::default()).unwrap();
        let speed = bag.add_connection::<Float32>("/speed").unwrap();
        bag.write(speed, Time::ZERO, &Float32 { data: 1.0 })
            .unwrap();
        assert!(!path.exists());
        if finish {
            bag.finish().unwrap();
            assert_eq!(names(folder.path()), ["a.bag"]);
        } else {
            drop(bag);
            assert!(names(folder.path()).is_empty());
        }
    }
    let missing = BagWriter::create(folder.path().join("no/a.bag"), WriterOptions::default())
        .err()
        .unwrap();
    assert!(
        matches!(missing, Error::File(FileError::NoSuchPath { .. })),
        "{missing}"
    );
}

#[test]
fn an_empty_bag_is_a_bag() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.bag");
    let mut writer = BagWriter::create(&path, WriterOptions::default()).unwrap();
    writer.add_connection::<Imu>("/imu").unwrap();
    writer.finish().unwrap();
    let bag = Bag::open(&path).unwrap();
    assert_eq!(
        (bag.message_count(), bag.time_range(), bag.damage()),
        (0, None, None)
    );
    assert_eq!(bag.topics().unwrap()[0].range, None);
    assert!(
        bag.messages(Selection::topics(["/imu"]))
            .unwrap()
            .next()
            .is_none()
    );
}

#[test]
fn a_message_larger_than_a_chunk_is_a_chunk() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.bag");
    let big: Vec<u8> = (0..3_000_000_u32).map(|i| (i / 1000) as u8).collect();
    for compression in COMPRESSIONS {
        let mut writer = BagWriter::create(
            &path,
            WriterOptions {
                compression,
                chunk_bytes: 0,
            },
        )
        .unwrap();
        let topic = writer
            .add_raw_connection("/blob", "a/Blob", "*", "uint8[] data\n")
            .unwrap();
        for i in 0..3 {
            writer
                .write_raw(
                    topic,
                    Time {
                        sec: 3 - i,
                        nsec: 0,
                    },
                    &big,
                )
                .unwrap();
        }
        writer.finish().unwrap();
        let bag = Bag::open(&path).unwrap();
        let messages: Vec<_> = bag
            .messages(Selection::all())
            .unwrap()
            .map(Result::unwrap)
            .collect();
        assert_eq!(
            messages.iter().map(|m| m.time().sec).collect::<Vec<_>>(),
            [1, 2, 3]
        );
        assert!(messages.iter().all(|m| m.data() == big));
        let wrong = messages[0].decode::<Imu>().unwrap_err();
        assert!(
            wrong
                .to_string()
                .contains("/blob has messages of type a/Blob, expected sensor_msgs/Imu"),
            "{wrong}"
        );
    }
}

#[test]
fn a_connection_of_another_bag_is_refused() {
    let folder = tempfile::tempdir().unwrap();
    let create =
        |name| BagWriter::create(folder.path().join(name), WriterOptions::default()).unwrap();
    let (mut one, mut other) = (create("a.bag"), create("b.bag"));
    let speed = one.add_connection::<Float32>("/speed").unwrap();
    let error = other
        .write(speed, Time::ZERO, &Float32 { data: 1.0 })
        .unwrap_err();
    assert!(
        matches!(error, Error::NoSuchConnection { connection: 0, .. }),
        "{error}"
    );
    let mut lines = Vec::new();
    Float32 { data: 1.5 }.lines("", &mut lines);
    assert_eq!(lines, ["data = 3ff8000000000000"]);
}
