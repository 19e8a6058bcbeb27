//! Messages of video streams compared exactly with what PyPI's `rosbags` writes (`reference/video_reference.py`), in each
//! serialisation.

use crate::common::{Lines, lines_of, read_json};
use deepfusion_rosbag::msg::{CompressedVideo, FfmpegPacket, OldFfmpegPacket};
use deepfusion_rosbag::{Connection, Message, RosMessage, Serialization, Time};
use serde::Deserialize;
use std::collections::BTreeMap;
use std::path::Path;
use std::sync::Arc;

#[derive(Deserialize)]
struct Type {
    md5: String,
    definition: String,
    ros1: String,
    /// Empty if there is no such message in ROS 2.
    #[serde(default)]
    cdr: String,
    #[serde(default)]
    cdr_big: String,
    values: Vec<String>,
    values_ros2: Vec<String>,
}

fn bytes(hex: &str) -> Vec<u8> {
    let pairs = hex.as_bytes().chunks(2);
    pairs
        .map(|pair| u8::from_str_radix(std::str::from_utf8(pair).unwrap(), 16).unwrap())
        .collect()
}

/// One message as a reader of bags gives it.
fn message(
    connection: &Connection,
    serialization: Serialization,
    bytes: Vec<u8>,
    check: impl Fn(&Message<'_>),
) {
    let range = 0..bytes.len();
    let path = Path::new("a.bag");
    check(&Message::held(
        path,
        connection,
        Time::ZERO,
        serialization,
        Arc::new(bytes),
        range,
    ));
}

fn check<'a, T: RosMessage<'a> + Lines>(expected: &Type, written: &'a [[Vec<u8>; 3]; 1]) {
    assert_eq!(
        (T::MD5, T::DEFINITION),
        (&*expected.md5, &*expected.definition)
    );
    let [[ros1, cdr, cdr_big]] = written;
    let decoded = T::decode(ros1).unwrap();
    assert_eq!(lines_of(&decoded), expected.values);
    let mut again = Vec::new();
    decoded.encode(&mut again);
    assert_eq!(&again, ros1);
    for end in 0..ros1.len() {
        assert!(T::decode(&ros1[..end]).is_err());
    }
    let connection = Connection {
        id: 0,
        topic: "/camera".into(),
        type_name: T::TYPE.into(),
        md5: T::MD5.into(),
        definition: String::new(),
        caller_id: None,
        latching: false,
        count: 1,
    };
    let stamp_of = |lines: &[String]| {
        let named = |l: &&String| l.contains("stamp = ");
        lines
            .iter()
            .find(named)
            .unwrap()
            .rsplit(' ')
            .next()
            .unwrap()
            .to_owned()
    };
    let stamp = stamp_of(&expected.values);
    message(&connection, Serialization::Ros1, ros1.clone(), |m| {
        assert_eq!(m.header_stamp().unwrap().to_string(), stamp);
        assert_eq!(m.header_frame().as_deref(), Some("camera"));
    });
    for cdr in [cdr, cdr_big].into_iter().filter(|b| !b.is_empty()) {
        let decoded = T::decode_cdr(cdr).unwrap();
        let mut found = lines_of(&decoded);
        // ROS 2 has no sequence numbers.
        found.retain(|line| !line.contains("header.seq = "));
        assert_eq!(found, expected.values_ros2);
        let stamp = stamp_of(&expected.values_ros2);
        message(&connection, Serialization::Cdr, cdr.clone(), |m| {
            assert_eq!(m.header_stamp().unwrap().to_string(), stamp);
            assert_eq!(m.header_frame().as_deref(), Some("camera"));
        });
    }
}

#[test]
fn packets_equal_those_of_rosbags() {
    let types: BTreeMap<String, Type> = read_json("video.json");
    let written = |name: &str| {
        let t = &types[name];
        [[bytes(&t.ros1), bytes(&t.cdr), bytes(&t.cdr_big)]]
    };
    check::<CompressedVideo<'_>>(&types["video"], &written("video"));
    check::<FfmpegPacket<'_>>(&types["packet"], &written("packet"));
    check::<OldFfmpegPacket<'_>>(&types["old_packet"], &written("old_packet"));
    assert!(types["packet"].cdr_big != types["packet"].cdr && types["old_packet"].cdr.is_empty());
}
